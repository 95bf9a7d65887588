// What is seen: surfaces, discs, arrows, and the legend to their colours.

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

// --- surfaces ---

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

// --- records ---

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

// --- colours and legend ---

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
