// Discs and arrows lie in the plane of their record; one program moves the corners of both.

const kPlaneVertex = `
  attribute vec3 centre, normalDir, axisDir;
  attribute vec2 extent;   // Along the axis and across it.
  attribute vec3 tint;
  attribute float lift;    // Small records lie on top of large ones.
  uniform float scale;
  varying vec3 vTint;
  varying vec2 vPlace;
  varying float vFacing;
  void main() {
    vec3 across = cross(normalDir, axisDir);
    vec3 p = centre + scale * (axisDir * extent.x * position.x + across * extent.y * position.y) + normalDir * lift;
    vec4 seen = modelViewMatrix * vec4(p, 1.0);
    vFacing = -dot(normalMatrix * normalDir, normalize(seen.xyz));
    vTint = tint;
    vPlace = position.xy;
    gl_Position = projectionMatrix * seen;
  }`;

const kDiscFragment = `
  uniform bool showBacks;
  varying vec3 vTint;
  varying vec2 vPlace;
  varying float vFacing;
  void main() {
    if (vFacing < 0.0 && !showBacks) discard;
    float edge = length(vPlace);
    float rim = smoothstep(0.80, 0.92, edge);
    vec3 colour = vTint * mix(1.0, 0.55, rim);
    gl_FragColor = vec4(vFacing < 0.0 ? colour * 0.45 : colour, 1.0);
  }`;

const kArrowFragment = `
  uniform bool showBacks;
  varying vec3 vTint;
  varying float vFacing;
  void main() {
    if (vFacing < 0.0 && !showBacks) discard;
    gl_FragColor = vec4(vTint, 1.0);
  }`;

// A light at the eye; grey, so that colours belong to records alone.
const kSurfaceVertex = `
  varying vec3 vNormal, vSeen;
  void main() {
    vec4 seen = modelViewMatrix * vec4(position, 1.0);
    vNormal = normalMatrix * normal;
    vSeen = seen.xyz;
    gl_Position = projectionMatrix * seen;
  }`;
const kSurfaceFragment = `
  varying vec3 vNormal, vSeen;
  void main() {
    float facing = abs(dot(normalize(vNormal), normalize(vSeen)));
    gl_FragColor = vec4(vec3(0.20, 0.215, 0.235) * (0.55 + 0.6 * facing), 1.0);
  }`;
