#include "study/figure_page_text.h"

namespace brume {

const char* const kPageStyle = R"css(
:root { --ink: #1c2430; --soft: #5b6675; --line: #d9dee5; --paper: #ffffff; --back: #f3f5f8; --accent: #0b5cad; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--back); color: var(--ink);
       font: 16px/1.55 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 0 24px 64px; }
header { background: #172133; color: #eef2f7; padding: 40px 0 32px; margin-bottom: 28px; }
header > div { max-width: 1180px; margin: 0 auto; padding: 0 24px; }
header h1 { margin: 0 0 8px; font-size: 30px; line-height: 1.2; }
header p { margin: 6px 0; max-width: 860px; color: #c5cfdd; }
nav { margin-top: 16px; display: flex; flex-wrap: wrap; gap: 8px; }
nav a { color: #eef2f7; text-decoration: none; border: 1px solid #44536b; border-radius: 16px; padding: 3px 12px; font-size: 14px; }
nav a:hover { background: #2b3a53; }
section { background: var(--paper); border: 1px solid var(--line); border-radius: 10px; padding: 24px 28px; margin: 0 0 28px; }
h2 { margin: 0 0 6px; font-size: 23px; }
h3 { margin: 28px 0 2px; font-size: 17px; }
p { margin: 8px 0; max-width: 900px; }
.scale, figcaption small, .note { color: var(--soft); font-size: 13.5px; }
.row { display: grid; gap: 14px; margin: 10px 0 4px; }
.row figure { margin: 0; }
.row img { width: 100%; display: block; border-radius: 4px; background: #000; }
.row.maps { grid-template-columns: repeat(auto-fit, minmax(180px, 1fr)); }
.row.maps img { image-rendering: pixelated; }
.row.pair { grid-template-columns: 4fr 3fr; max-width: 760px; }
.row.pair figure:first-child img { image-rendering: auto; }
.row.frames { grid-template-columns: repeat(auto-fit, minmax(320px, 1fr)); }
figcaption { font-size: 14px; margin-top: 4px; line-height: 1.35; }
figcaption small { display: block; }
.bar { display: inline-flex; align-items: center; gap: 8px; font-size: 13.5px; color: var(--soft); }
.bar i { display: inline-block; width: 200px; height: 12px; border-radius: 3px; }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(430px, 1fr)); gap: 22px; margin-top: 12px; }
.charts.wide { grid-template-columns: 1fr; }
.chart { height: 340px; position: relative; }
.charts.wide .chart { height: 380px; }
table { border-collapse: collapse; margin: 12px 0; font-size: 14.5px; font-variant-numeric: tabular-nums; }
th, td { padding: 5px 12px; text-align: right; border-bottom: 1px solid var(--line); }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
thead th { color: var(--soft); font-weight: 600; border-bottom: 2px solid var(--line); vertical-align: bottom; }
td.best { font-weight: 700; color: var(--accent); }
.scroll { overflow-x: auto; }
)css";

const char* const kPageScript = R"js(
'use strict';
(() => {
  const charts = JSON.parse(document.getElementById('charts').textContent);
  const number = v => {
    const size = Math.abs(v);
    return size !== 0 && (size < 1e-3 || size >= 1e5) ? v.toExponential(1) : String(+v.toPrecision(3));
  };
  // On a logarithmic axis only 1, 2 and 5 of each decade are labelled.
  const decade = v => [1, 2, 5].includes(Math.round(v / 10 ** Math.floor(Math.log10(v) + 1e-9))) ? number(v) : '';
  const axis = (label, isLog, unit) => ({
    type: isLog ? 'logarithmic' : 'linear',
    title: {display: true, text: unit ? `${label} [${unit}]` : label, font: {size: 13}},
    grid: {color: '#e6eaf0'},
    ticks: {callback: v => isLog ? decade(v) : number(v), maxRotation: 0, autoSkipPadding: 12},
  });
  Chart.defaults.font.family = 'system-ui, "Segoe UI", "DejaVu Sans", sans-serif';
  Chart.defaults.color = '#3a4554';
  for (const chart of charts) {
    const isBar = chart.kind === 'bar';
    const x = isBar ? {title: {display: true, text: chart.x}, grid: {display: false}}
                    : axis(chart.x, chart.log, chart.x_unit);
    new Chart(document.getElementById(chart.id), {
      type: isBar ? 'bar' : 'line',
      data: {
        labels: isBar ? chart.labels : undefined,
        datasets: chart.series.map(s => ({
          label: s.name, data: s.data, borderColor: s.color, backgroundColor: isBar ? s.color : s.fill || s.color,
          borderWidth: isBar ? 0 : s.width || 2, borderDash: s.dash || [], pointRadius: s.points || 0,
          pointHoverRadius: 4, tension: 0, order: s.order || 0,
        })),
      },
      options: {
        animation: false, responsive: true, maintainAspectRatio: false,
        interaction: {mode: isBar ? 'index' : 'nearest', intersect: false},
        scales: {x, y: axis(chart.y, chart.log, chart.y_unit)},
        plugins: {
          title: {display: true, text: chart.title, font: {size: 15}},
          legend: {position: 'bottom', labels: {boxWidth: 26, boxHeight: 2, padding: 12}},
          tooltip: {callbacks: {label: c => `${c.dataset.label}: ${number(c.parsed.y)}`}},
        },
      },
    });
  }
  document.documentElement.dataset.charts = String(charts.length);
})();
)js";

const char* const kPageIntroduction = R"html(
<p>Irradiance is gathered at few points and carried to its neighbours by its gradient. In smoke, dust and haze
the gradient has to know the medium <em>and</em> what hides it. Every number here is from a run of
<code>brume figures</code>; nothing is copied from elsewhere.</p>
<p><b>Full</b> (ours) moves the walls between cells of the hemisphere at the distance of what is seen in each shell, and
knows how the medium dims. <b>Media</b> knows the medium but no occlusion. <b>Ward-Heckbert</b> knows occlusion by
surfaces and takes the medium's light for theirs. <b>None</b> is a constant. All modes use the same samples.</p>
)html";

const char* const kPageInterpolation = R"html(<h3>Interpolated irradiance</h3>
<p>relMSE at pixels of each view against converged gathers there, whose own noise is taken off (by the product of
the differences from two independent ones). In a row, records, radii and irradiance are the same; only the gradients
differ. Records of a bake at default accuracy lie so close that much of what is left is the noise of the records
themselves, which no gradient takes away.</p>
)html";

const char* const kPageSparseInterpolation = R"html(
<p>The same with a random quarter of those records and twice their radii, about what half the accuracy would leave.
Here irradiance is carried further, and gradients matter more.</p>
)html";

SceneText scene_text_of(const std::string& name) {
  if (name == "absorbing")
    return {
        "Absorbing",
        R"(A panel in a lamp's beam reflects light past a block and through absorbing clouds onto
the ground. The lamp itself does not reach the ground.)",
        R"(Next to the shadow of the block, clouds dim the light of the panel. Ward-Heckbert gradients see the block
and the edges of the panel, not the clouds; the media gradient sees the clouds, not the block. Where records lie far apart, the curve of irradiance decides the
error of extrapolation, and a slope that is too small may do as well as the true one.)"};
  if (name == "scattering")
    return {
        "Scattering",
        R"(The same ground and block in an even scattering medium. The lamp hangs above a plate
whose shadow covers the ground whole: all light comes scattered.)",
        R"(Nearly all of the irradiance is light that the medium scattered beside the plate. Ward-Heckbert takes that
light for the surface behind it.)"};
  if (name == "no-walls")
    return {
        "No walls",
        R"(Open ground under clouds in the sun. No surface sends light to another, and nothing hides
anything: only the medium makes irradiance change.)",
        R"(Ward-Heckbert gradients are zero everywhere, since there is nothing at any distance that they could see.)"};
  if (name == "smoky-cornell")
    return {
        "Smoky Cornell box",
        R"(The demo: smoke that rises from the low block, a ceiling lamp and a beam through the
smoke.)",
        R"(Both frames use the same records, the same radii and the same irradiance; only the gradients differ.)"};
  if (name == "window")
    return {
        "Beam through a window",
        R"(The sun comes through a window into a dusty room. The sky behind it lights the
room too.)",
        R"(Light scattered in the shafts falls on walls and furniture; how it changes there is what the gradients
have to know.)"};
  return {
      "Disco ball",
      R"(Beams of light from a ball of mirrors go through haze. Each beam is a narrow spot light.)",
      R"(Many narrow beams close to surfaces: irradiance from the medium changes over short distances.)"};
}

}  // namespace brume
