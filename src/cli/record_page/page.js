// The view: scene, camera, controls, legend and what the pointer finds.

const $ = (id) => document.getElementById(id);
const view = $('view');
const state = {
  mode: 0,
  layer: data.layers[data.layers.length - 1],
  visible: [],
  hovered: -1,
  held: -1
};

let renderer;
try {
  renderer = new THREE.WebGLRenderer({canvas: view, antialias: true});
} catch (error) {
  document.body.insertAdjacentHTML('beforeend', '<p id="failure">This browser shows no WebGL.</p>');
  throw error;
}
renderer.setClearColor(0x101317);
const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(40, 1, 0.01, 100);

// ---- surfaces
// ------------------------------------------------------------------------------------------

function addSurfaces(text, side) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(decoded(text, Float32Array), 3));
  geometry.computeVertexNormals();
  const material = new THREE.ShaderMaterial({
    vertexShader: kSurfaceVertex,
    fragmentShader: kSurfaceFragment,
    side,
    polygonOffset: true,
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1
  });
  const mesh = new THREE.Mesh(geometry, material);
  mesh.frustumCulled = false;
  surfaces.add(mesh);
}
const surfaces = new THREE.Group();
// Turned to their records' side: seen from behind they are left out, so that closed rooms can be
// looked into.
if (data.surfaces) {
  addSurfaces(data.surfaces.turned, THREE.FrontSide);
  addSurfaces(data.surfaces.twoSided, THREE.DoubleSide);
}
scene.add(surfaces);

// ---- records
// -------------------------------------------------------------------------------------------

function planeMaterial(fragmentShader) {
  return new THREE.ShaderMaterial({
    vertexShader: kPlaneVertex,
    fragmentShader,
    side: THREE.DoubleSide,
    uniforms: {scale: {value: 1}, showBacks: {value: false}}
  });
}
const discMaterial = planeMaterial(kDiscFragment), arrowMaterial = planeMaterial(kArrowFragment);
let discs = null, arrows = null;

function discShape(segments) {
  const corners = [0, 0, 0], faces = [];
  for (let i = 0; i < segments; ++i) {
    const a = 2 * Math.PI * i / segments;
    corners.push(Math.cos(a), Math.sin(a), 0);
    faces.push(0, 1 + i, 1 + (i + 1) % segments);
  }
  return {corners, faces};
}
// Along x from 0 to 1.
const kArrowShape = {
  corners: [
    0, -0.035, 0,     0.72, -0.035, 0, 0.72, 0.035, 0,    0, 0.035,
    0, 0.72,   -0.13, 0,    1,      0, 0,    0.72,  0.13, 0
  ],
  faces: [0, 1, 2, 0, 2, 3, 4, 5, 6],
};

function instanced(shape, material, list, attributes) {
  const geometry = new THREE.InstancedBufferGeometry();
  geometry.setAttribute('position', new THREE.Float32BufferAttribute(shape.corners, 3));
  geometry.setIndex(shape.faces);
  for (const [name, size, write] of attributes) {
    const array = new Float32Array(size * list.length);
    list.forEach((i, k) => array.set(write(i), size * k));
    geometry.setAttribute(name, new THREE.InstancedBufferAttribute(array, size));
  }
  geometry.maxInstancedCount = geometry.instanceCount =
      list.length;  // Before and after release 117.
  const mesh = new THREE.Mesh(geometry, material);
  mesh.frustumCulled = false;
  return mesh;
}

function dispose(mesh) {
  if (!mesh) return;
  scene.remove(mesh);
  mesh.geometry.dispose();
}

// Records of one plane are drawn over each other: the wider, the lower. Each has a height of its
// own, and is drawn after those below it.
const lifts = new Float32Array(count);
const liftOf = (i) => lifts[i];

function rebuild() {
  state.visible = [];
  for (let i = 0; i < count; ++i)
    if (state.layer < 0 || value(i, 'layer') === state.layer) state.visible.push(i);
  state.visible.sort((a, b) => radiusOf(b) - radiusOf(a) || a - b);
  state.visible.forEach((i, rank) => {
    lifts[i] = data.diagonal * (4e-4 + 2e-3 * rank / state.visible.length);
  });
  state.colours = colouring();
  dispose(discs);
  discs =
      instanced(discShape(state.visible.length > 20000 ? 16 : 32), discMaterial, state.visible, [
        ['centre', 3, (i) => vector(i, 'position')], ['normalDir', 3, (i) => vector(i, 'normal')],
        ['axisDir', 3, (i) => vector(i, 'axis')],
        ['extent', 2, (i) => [value(i, 'radius'), value(i, 'radius', 1)]],
        ['tint', 3, state.colours.of], ['lift', 1, (i) => [liftOf(i)]]
      ]);
  discs.renderOrder = 1;
  scene.add(discs);

  dispose(arrows);
  const withGradient = state.visible.filter((i) => changeOf(i) > 1e-3);
  arrows = instanced(kArrowShape, arrowMaterial, withGradient, [
    ['centre', 3, (i) => vector(i, 'position')], ['normalDir', 3, (i) => vector(i, 'normal')],
    [
      'axisDir', 3,
      (i) => {
        const g = vector(i, 'surfaceGradient'), l = lengthOf(g);
        return g.map((x) => x / l);
      }
    ],
    // The shaft grows thicker with the disc, not with the gradient.
    ['extent', 2, (i) => [radiusOf(i) * Math.min(changeOf(i) * kArrowGain, 2), radiusOf(i)]],
    ['tint', 3, () => [1, 1, 1]], ['lift', 1, (i) => [liftOf(i) + data.diagonal * 1e-4]]
  ]);
  arrows.visible = $('arrows').checked;
  arrows.renderOrder = 3;
  scene.add(arrows);

  $('subtitle').textContent = `${data.total.toLocaleString('en')} records` +
      (count < data.total ? `, ${count.toLocaleString('en')} of them here` : '') +
      `; ${state.visible.length.toLocaleString('en')} shown`;
  showLegend();
  document.body.dataset.discs = state.visible.length;
  document.body.dataset.arrows = withGradient.length;
  requestFrame();
}
const kArrowGain =
    4;  // A quarter of the irradiance over the radius makes an arrow as long as the radius.

// ---- colours and legend
// --------------------------------------------------------------------------------

const quantile = (sorted, q) => sorted[Math.round(q * (sorted.length - 1))];

// How the visible records are coloured: of(i), and what the legend says.
function colouring() {
  const mode = kModes[state.mode];
  if (mode.kind === 'rgb') {
    const lights = state.visible.map(lightOf).sort((a, b) => a - b);
    const white = (quantile(lights, 0.99) || 1) * 1.2;
    const encoded = (x) => {
      x = Math.min(Math.max(x, 0), 1);
      return x <= 0.0031308 ? 12.92 * x : 1.055 * Math.pow(x, 1 / 2.4) - 0.055;
    };
    return {white, of: (i) => vector(i, 'irradiance').map((e) => encoded(e / white))};
  }
  if (mode.kind === 'steps') {
    const steps = [...new Set(state.visible.map(mode.of))].sort((a, b) => a - b);
    const colourOf = (k) =>
        mapColour(steps.length > 1 ? 0.08 + 0.88 * k / (steps.length - 1) : 0.5);
    const at = new Map(steps.map((s, k) => [s, colourOf(k)]));
    return {steps, of: (i) => at.get(mode.of(i))};
  }
  const values = state.visible.map(mode.of).sort((a, b) => a - b);
  let [low, high] = mode.fixed || [quantile(values, 0.01), quantile(values, 0.99)];
  const isLog = $('logarithmic').checked && !mode.fixed;
  if (!isLog && !mode.fixed && low < 0.3 * high) low = 0;
  if (isLog) low = Math.max(low, high * 1e-4);
  if (!(high > low)) high = low > 0 ? low * 1.001 : 1;
  const part = isLog ? (x) => x > 0 ? Math.log(x / low) / Math.log(high / low) : 0 :
                       (x) => (x - low) / (high - low);
  const at = isLog ? (t) => low * Math.pow(high / low, t) : (t) => low + (high - low) * t;
  return {low, high, at, of: (i) => mapColour(part(mode.of(i)))};
}

function showLegend() {
  const mode = kModes[state.mode], colours = state.colours, legend = $('legend');
  legend.innerHTML =
      `<h2>${mode.name} <span style="color:var(--dim);font-weight:400">[${mode.unit}]</span></h2>`;
  if (mode.kind === 'rgb') {
    legend.insertAdjacentHTML(
        'beforeend', `<p class="note">As it looks; white is ${shown(colours.white)} W/m².</p>`);
  } else if (mode.kind === 'steps') {
    legend.insertAdjacentHTML(
        'beforeend',
        '<div class="swatches">' +
            colours.steps
                .map((step, k) => {
                  const rgb = mapColour(
                      colours.steps.length > 1 ? 0.08 + 0.88 * k / (colours.steps.length - 1) :
                                                 0.5);
                  const n = state.visible.filter((i) => mode.of(i) === step).length;
                  return `<span><i style="background:rgb(${
                      rgb.map((c) => Math.round(255 * c))})"></i>${step}: ${
                      n.toLocaleString('en')}</span>`;
                })
                .join('') +
            '</div>');
  } else {
    const bar = document.createElement('canvas');
    bar.width = 256;
    bar.height = 1;
    const context = bar.getContext('2d');
    for (let x = 0; x < 256; ++x) {
      context.fillStyle = `rgb(${mapColour(x / 255).map((c) => Math.round(255 * c))})`;
      context.fillRect(x, 0, 1, 1);
    }
    legend.appendChild(bar);
    legend.insertAdjacentHTML(
        'beforeend',
        '<div class="ticks">' +
            [0, 0.25, 0.5, 0.75, 1].map((t) => `<span>${shown(colours.at(t))}</span>`).join('') +
            '</div>');
  }
  legend.insertAdjacentHTML(
      'beforeend',
      `<p class="note">Discs are drawn at ${Math.round(100 * $('size').value)} % of their radius.` +
          (arrows.visible ? ` An arrow as long as its disc: irradiance changes by ${
                                100 / kArrowGain} % over the radius.` :
                            '') +
          '</p>');
}

// ---- camera
// --------------------------------------------------------------------------------------------

const orbit = {
  target: new THREE.Vector3(),
  distance: 1,
  turn: 0,
  rise: 0,
  up: new THREE.Vector3(...data.up)
};
const upFrame = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), orbit.up);

function placeCamera() {
  const c = Math.cos(orbit.rise);
  const away =
      new THREE.Vector3(c * Math.sin(orbit.turn), Math.sin(orbit.rise), c * Math.cos(orbit.turn))
          .applyQuaternion(upFrame);
  camera.position.copy(orbit.target).addScaledVector(away, orbit.distance);
  camera.up.copy(orbit.up);
  camera.lookAt(orbit.target);
  camera.near = Math.max(orbit.distance - data.diagonal, orbit.distance * 0.01);
  camera.far = orbit.distance + data.diagonal * 2;
  camera.updateProjectionMatrix();
  requestFrame();
}
function lookFrom(position, target) {
  const away = new THREE.Vector3().subVectors(position, target);
  orbit.distance = away.length() || data.diagonal;
  away.normalize().applyQuaternion(upFrame.clone().conjugate());
  orbit.target.copy(target);
  orbit.turn = Math.atan2(away.x, away.z);
  orbit.rise = Math.asin(Math.max(-1, Math.min(1, away.y)));
  placeCamera();
}
function fit() {
  camera.fov = 36;
  const centre = new THREE.Vector3();
  lookFrom(
      new THREE.Vector3(0.62, 0.42, 1)
          .normalize()
          .applyQuaternion(upFrame)
          .multiplyScalar(data.diagonal * 1.62 / Math.min(1, camera.aspect))
          .add(centre),
      centre);
}
function sceneCamera() {
  camera.fov = data.camera.fov;
  const position = new THREE.Vector3(...data.camera.position),
        toward = new THREE.Vector3(...data.camera.look_at).sub(position);
  // Turning about what is looked at; a target inside a wall is as good as any.
  lookFrom(position, position.clone().add(toward));
}

let dragging = null;
view.addEventListener('contextmenu', (e) => e.preventDefault());
view.addEventListener('pointerdown', (e) => {
  dragging = {x: e.clientX, y: e.clientY, moved: 0, shift: e.button === 2 || e.shiftKey};
  view.setPointerCapture(e.pointerId);
});
view.addEventListener('pointermove', (e) => {
  if (!dragging) {
    hover(e);
    return;
  }
  const dx = e.clientX - dragging.x, dy = e.clientY - dragging.y;
  dragging.moved += Math.abs(dx) + Math.abs(dy);
  dragging.x = e.clientX;
  dragging.y = e.clientY;
  if (dragging.shift) {
    const pixel = 2 * orbit.distance * Math.tan(camera.fov * Math.PI / 360) / view.clientHeight;
    const right = new THREE.Vector3().setFromMatrixColumn(camera.matrix, 0),
          up = new THREE.Vector3().setFromMatrixColumn(camera.matrix, 1);
    orbit.target.addScaledVector(right, -dx * pixel).addScaledVector(up, dy * pixel);
  } else {
    orbit.turn -= dx * 0.006;
    orbit.rise = Math.max(-1.55, Math.min(1.55, orbit.rise + dy * 0.006));
  }
  placeCamera();
});
view.addEventListener('pointerup', (e) => {
  if (dragging && dragging.moved < 4) {
    state.held = -1;
    hover(e);
    state.held = state.hovered;
    showRecord();
  }
  dragging = null;
});
view.addEventListener('wheel', (e) => {
  e.preventDefault();
  orbit.distance *= Math.exp(Math.max(-100, Math.min(100, e.deltaY)) * 0.002);
  placeCamera();
}, {passive: false});

// ---- what the pointer finds
// ----------------------------------------------------------------------------

// The nearest disc along a ray, as it is drawn.
function discAlong(origin, direction) {
  const scale = Number($('size').value), backs = $('backs').checked;
  let nearest = Infinity, found = -1;
  for (const i of state.visible) {
    const n = vector(i, 'normal'), e = vector(i, 'axis'), p = vector(i, 'position');
    const slope = n[0] * direction.x + n[1] * direction.y + n[2] * direction.z;
    if (slope === 0 || (slope > 0 && !backs)) continue;
    const lift = liftOf(i);
    const t =
        (n[0] * (p[0] - origin.x) + n[1] * (p[1] - origin.y) + n[2] * (p[2] - origin.z) + lift) /
        slope;
    if (!(t > 0 && t < nearest)) continue;
    const d = [
      origin.x + t * direction.x - p[0], origin.y + t * direction.y - p[1],
      origin.z + t * direction.z - p[2]
    ];
    const x = d[0] * e[0] + d[1] * e[1] + d[2] * e[2];
    const f = [n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0]];
    const y = d[0] * f[0] + d[1] * f[1] + d[2] * f[2];
    if (Math.hypot(x / value(i, 'radius'), y / value(i, 'radius', 1)) <= scale) {
      nearest = t;
      found = i;
    }
  }
  return found;
}
function hover(e) {
  if (state.held >= 0) return;
  const box = view.getBoundingClientRect();
  const ray = new THREE.Raycaster();
  ray.setFromCamera(
      {
        x: 2 * (e.clientX - box.left) / box.width - 1,
        y: 1 - 2 * (e.clientY - box.top) / box.height
      },
      camera);
  const found = discAlong(ray.ray.origin, ray.ray.direction);
  if (found === state.hovered) return;
  state.hovered = found;
  showRecord();
}

let marker = null;
function showRecord() {
  const i = state.hovered, table = $('record');
  dispose(marker);
  marker = null;
  $('record-title').textContent =
      i < 0 ? 'Record' : `Record ${indices[i]}` + (state.held >= 0 ? ' (held)' : '');
  if (i < 0) {
    table.innerHTML = '<tr><td class="hint">Point at a disc; click to hold it.</td></tr>';
  } else {
    const hex = (word) => word.toString(16).padStart(8, '0');
    const list = [
      ['key', hex(keys[2 * i + 1]) + hex(keys[2 * i])],
      ['bounce, wave', `${value(i, 'layer')}, ${value(i, 'wave')}`],
      ['position', shownList(vector(i, 'position').map((x, a) => x + data.centre[a]))],
      ['normal', shownList(vector(i, 'normal'))],
      ['irradiance', shownList(vector(i, 'irradiance')) + ' W/m²'],
      ['error', `${shown(value(i, 'error'))} W/m² (${shown(100 * kModes[2].of(i))} %)`],
      ['radii', `${shown(value(i, 'radius'))}  ${shown(value(i, 'radius', 1))}`],
      ...['R', 'G', 'B'].map((name, c) => [`gradient ${name}`, shownList([
                                             0, 1, 2
                                           ].map((a) => value(i, 'gradient', 3 * c + a)))]),
      ['over radius', `${shown(100 * changeOf(i))} % of irradiance`],
      ['from medium', `${shown(100 * value(i, 'mediaShare'))} %`]
    ];
    table.innerHTML =
        list.map(([name, text]) => `<tr><td>${name}</td><td>${text}</td></tr>`).join('');
    marker = instanced(discShape(48), discMaterial, [i], [
      ['centre', 3, (k) => vector(k, 'position')], ['normalDir', 3, (k) => vector(k, 'normal')],
      ['axisDir', 3, (k) => vector(k, 'axis')],
      ['extent', 2, (k) => [value(k, 'radius') * 1.04, value(k, 'radius', 1) * 1.04]],
      ['tint', 3, () => [1, 0.55, 0.1]], ['lift', 1, (k) => [data.diagonal * 2.5e-3]]
    ]);
    marker.renderOrder = 2;
    scene.add(marker);
  }
  document.body.dataset.record = i < 0 ? '' : indices[i];
  requestFrame();
}

// ---- page
// ----------------------------------------------------------------------------------------------

let frameIsWanted = false;
function requestFrame() {
  if (frameIsWanted) return;
  frameIsWanted = true;
  requestAnimationFrame(() => {
    frameIsWanted = false;
    renderer.render(scene, camera);
  });
}
function resize() {
  renderer.setPixelRatio(window.devicePixelRatio);
  renderer.setSize(view.clientWidth, view.clientHeight, false);
  camera.aspect = view.clientWidth / view.clientHeight;
  placeCamera();
}

// "#colour=error&arrows&size=1": how the page opens.
function applyAddress() {
  const wishes = new URLSearchParams(location.hash.slice(1));
  const mode = kModes.findIndex((m) => m.name === wishes.get('colour'));
  if (mode >= 0) state.mode = mode;
  if (wishes.has('layer')) state.layer = Number(wishes.get('layer'));
  if (wishes.has('size')) $('size').value = wishes.get('size');
  for (const id of ['arrows', 'logarithmic', 'backs'])
    if (wishes.has(id)) $(id).checked = true;
  if (wishes.has('record')) {
    const i = indices.indexOf(Number(wishes.get('record')));
    if (i >= 0) state.hovered = state.held = i;
  }
  return wishes.get('view') === 'camera' && data.camera;
}

document.title = data.title + ' – brume records';
$('title').textContent = data.title;
$('colour').innerHTML = kModes.map((m, k) => `<option value="${k}">${m.name}</option>`).join('');
$('layer').innerHTML =
    [...data.layers]
        .reverse()
        .map((l, k) => `<option value="${l}">${l}${k === 0 ? ' (what eye rays ask)' : ''}</option>`)
        .join('') +
    '<option value="-1">all</option>';
const escaped = (text) =>
    String(text).replace(/[&<>]/g, (c) => ({'&': '&amp;', '<': '&lt;', '>': '&gt;'})[c]);
$('cache').innerHTML =
    data.facts.map(([name, text]) => `<tr><td>${escaped(name)}</td><td>${escaped(text)}</td></tr>`)
        .join('');
$('surfaces').checked = Boolean(data.surfaces);
$('surfaces').disabled = !data.surfaces;
$('camera').disabled = !data.camera;
const startsAtCamera = applyAddress();
$('colour').value = state.mode;
$('layer').value = state.layer;

function applyLooks() {
  discMaterial.uniforms.scale.value = Number($('size').value);
  discMaterial.uniforms.showBacks.value = arrowMaterial.uniforms.showBacks.value =
      $('backs').checked;
  surfaces.visible = $('surfaces').checked;
  // Surfaces tell which discs are hidden; between discs of one surface, the order they are drawn
  // in.
  discMaterial.depthWrite = arrowMaterial.depthWrite = !surfaces.visible;
  $('size-shown').textContent = Math.round(100 * $('size').value) + ' %';
  if (arrows) arrows.visible = $('arrows').checked;
  if (arrows) showLegend();
  requestFrame();
}
$('colour').addEventListener('change', (e) => {
  state.mode = Number(e.target.value);
  rebuild();
});
$('layer').addEventListener('change', (e) => {
  state.layer = Number(e.target.value);
  state.held = state.hovered = -1;
  showRecord();
  rebuild();
});
$('logarithmic').addEventListener('change', rebuild);
for (const id of ['size', 'arrows', 'surfaces', 'backs'])
  $(id).addEventListener('input', applyLooks);
$('fit').addEventListener('click', fit);
$('camera').addEventListener('click', sceneCamera);
window.addEventListener('resize', resize);

resize();
startsAtCamera ? sceneCamera() : fit();
rebuild();
applyLooks();
if (state.held >= 0) showRecord();
renderer.render(scene, camera);
document.body.dataset.state = 'ready';
