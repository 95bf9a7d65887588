// How it is looked at: camera, pointer, and the controls of the page.

// --- camera ---

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

// --- what the pointer finds ---

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

// --- page ---

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
