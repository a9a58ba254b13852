// The volume of each pair over time.

const EDGE = 8;  // px, the half of the slider's thumb: the chart's time is that of the slider
const curves = pairs.map(() => []);  // [frame, volume], ...
let largest = 0;
for (let frame = 0; frame <= last; frame++) {
  for (let s = film.sighting_start[frame]; s < film.sighting_start[frame + 1]; s++) {
    curves[film.sighting_pair[s]].push([frame, film.numbers[s]]);
    largest = Math.max(largest, film.numbers[s]);
  }
}
const background = document.createElement("canvas");

function place(frame, volume) {
  const {width, height} = chart, edge = EDGE * devicePixelRatio;
  return [edge + (width - 2 * edge) * (times[last] ? times[frame] / times[last] : 0), (height - 2) * (1 - 0.95 * volume / (largest || 1)) + 1];
}

// A curve falls to zero where its pair is apart.
function trace(context, curve) {
  context.beginPath();
  let before = -2;
  for (const [frame, volume] of curve) {
    if (frame !== before + 1) context.moveTo(...place(Math.max(frame - 1, 0), frame ? 0 : volume));
    context.lineTo(...place(frame, volume));
    if (last === 0) context.lineTo(chart.width, place(frame, volume)[1]);
    before = frame;
    if (frame < last && !curve.next?.has(frame + 1)) context.lineTo(...place(frame + 1, 0));
  }
  context.stroke();
}
for (const curve of curves) curve.next = new Set(curve.map(([frame]) => frame));

function sizeChart() {
  for (const canvas of [chart, background]) [canvas.width, canvas.height] = [chart.clientWidth * devicePixelRatio, chart.clientHeight * devicePixelRatio];
  const context = background.getContext("2d");
  context.lineWidth = devicePixelRatio;
  context.strokeStyle = "#4a5260";
  context.beginPath();
  context.moveTo(...place(0, 0));
  context.lineTo(...place(last, 0));
  context.stroke();
  context.strokeStyle = curves.length > 20 ? "#9aa3b070" : "#9aa3b0c0";
  for (const curve of curves) trace(context, curve);
  drawChart();
}

function drawChart() {
  const context = chart.getContext("2d");
  context.clearRect(0, 0, chart.width, chart.height);
  context.drawImage(background, 0, 0);
  context.lineWidth = 2 * devicePixelRatio;
  for (const [pair, color] of [[hovered, "#e8ebf0"], [chosen, "#ff4fa3"]]) {
    if (pair < 0) continue;
    context.strokeStyle = color;
    trace(context, curves[pair]);
  }
  if (shown >= 0) {
    const [x] = place(shown, 0);
    context.fillStyle = "#e8ebf0";
    context.fillRect(x - devicePixelRatio / 2, 0, devicePixelRatio, chart.height);
  }
  const pair = hovered >= 0 ? hovered : chosen;
  const top = document.createElement("div");
  top.textContent = largest ? `volume, up to ${inUnit(largest, units, 3).slice(0, 2).join(" ")}` : "nothing is shared";
  byId("caption").replaceChildren(top, ...(pair >= 0 ? named(pair) : []));
}

// The pair whose curve is nearest to a point of the chart.
function curveAt(x, y) {
  const frame = frameAt(timeAt(x));
  let best = -1, nearest = 12 * devicePixelRatio;
  for (let s = film.sighting_start[frame]; s < film.sighting_start[frame + 1]; s++) {
    const off = Math.abs(place(frame, film.numbers[s])[1] - y * devicePixelRatio);
    if (off < nearest) [best, nearest] = [film.sighting_pair[s], off];
  }
  return best;
}

function timeAt(x) {
  return times[last] * Math.min(Math.max((x - EDGE) / (chart.clientWidth - 2 * EDGE), 0), 1);
}

chart.onpointermove = event => {
  hover(curveAt(event.offsetX, event.offsetY));
  if (event.buttons) pauseAt(frameAt(timeAt(event.offsetX)));
};
chart.onpointerleave = () => hover(-1);
chart.onpointerdown = event => {
  chart.setPointerCapture(event.pointerId);
  const pair = curveAt(event.offsetX, event.offsetY);
  if (pair >= 0) choose(pair);
  pauseAt(frameAt(timeAt(event.offsetX)));
};
new ResizeObserver(sizeChart).observe(chart);
