'use strict';
// The cache's numbers as the page holds them, and what can be shown of a record.

const data = JSON.parse(document.getElementById('data').textContent);

function decoded(text, type) {
  const bytes = atob(text), array = new Uint8Array(bytes.length);
  for (let i = 0; i < bytes.length; ++i) array[i] = bytes.charCodeAt(i);
  return new type(array.buffer);
}

// One row a record; the order of write_records() in record_page.cpp.
const kStride = 30;
const kAt = {
  position: 0,
  normal: 3,
  axis: 6,
  irradiance: 9,
  gradient: 12,
  radius: 21,
  error: 23,
  mediaShare: 24,
  layer: 25,
  wave: 26,
  surfaceGradient: 27
};
const rows = decoded(data.records, Float32Array);
const keys = decoded(data.keys, Uint32Array);  // Low and high word of each.
const indices = decoded(data.indices, Uint32Array);
const count = indices.length;

const value = (i, field, part = 0) => rows[i * kStride + kAt[field] + part];
const vector = (i, field) => [value(i, field), value(i, field, 1), value(i, field, 2)];
const luminanceOf = (c) => 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
const lightOf = (i) => luminanceOf(vector(i, 'irradiance'));
const radiusOf = (i) => Math.sqrt(value(i, 'radius') * value(i, 'radius', 1));
const lengthOf = (v) => Math.hypot(v[0], v[1], v[2]);
// Change of irradiance over the record's radius, relative to it.
const changeOf = (i) => {
  const light = lightOf(i);
  return light > 0 ? lengthOf(vector(i, 'surfaceGradient')) * radiusOf(i) / light : 0;
};

// kind: "range" has a colour bar, "steps" one colour a value, "rgb" the light's own colour.
const kModes = [
  {name: 'irradiance', kind: 'range', unit: 'W/m²', of: lightOf},
  {name: 'irradiance, in colour', kind: 'rgb', unit: 'W/m²'},
  {
    name: 'error',
    kind: 'range',
    unit: 'of irradiance',
    of: (i) => lightOf(i) > 0 ? value(i, 'error') / lightOf(i) : 0
  },
  {name: 'radius', kind: 'range', unit: 'scene units', of: radiusOf},
  {name: 'gradient', kind: 'range', unit: 'change over the radius, of irradiance', of: changeOf},
  {
    name: 'from the medium',
    kind: 'range',
    unit: 'of irradiance',
    of: (i) => value(i, 'mediaShare'),
    fixed: [0, 1]
  },
  {name: 'wave', kind: 'steps', unit: 'coarse to fine', of: (i) => value(i, 'wave')},
  {name: 'bounce', kind: 'steps', unit: 'layer of the cache', of: (i) => value(i, 'layer')},
];

// Between two colours of the table, which runs from 0 to 1.
function mapColour(t) {
  const at = Math.min(Math.max(t, 0), 1) * (data.map.length - 1),
        k = Math.min(Math.floor(at), data.map.length - 2);
  return data.map[k].map((low, c) => (low + (data.map[k + 1][c] - low) * (at - k)) / 255);
}

const shown = (x, digits = 4) => {
  if (x === 0) return '0';
  const size = Math.abs(x);
  const text = size >= 1e5 || size < 1e-3 ? x.toExponential(digits - 2) :
                                            String(Number(x.toPrecision(digits)));
  return text.replaceAll('-', '\u2212');  // A minus sign, at which no line breaks.
};
const shownList = (list) => list.map((x) => shown(x, 3)).join('\u2002');
