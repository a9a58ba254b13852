// The chart over time: volume, depth or force of each pair or of all pairs, linear or logarithmic.

const LEFT = 60, RIGHT = 12, TOP = 20, BOTTOM = 20;  // px; the slider's ends are at the same places
const CURVES = 200;  // the largest: more curves cannot be told apart
const kind = {by: "volume", total: false, logarithmic: false};
let curves = [], drawnCurves = [], largest = 0, smallest = 0, unit = [];  // [frame, value], ... of each pair, or one of all
const charted = ["volume", "depth", ...film.forces ? ["force"] : []];
if (film.forces) byId("of-depth").after(element("button", {id: "of-force", textContent: "force", title: "(d)"}));
const together = {
  volume: {button: "total", title: " in total"},
  depth: {button: "deepest", title: ", the deepest"},
  force: {button: "strongest", title: ", the strongest"},
};
const background = document.createElement("canvas");

// The pairs with the largest volumes have a colour each, apart from the colours of bodies. The others are grey.
const HUES = ["#f0e442", "#3ddc97", "#b497ff", "#ff7f6b", "#5fe0e6", "#c9e265", "#e7a6d8", "#d9b38c"];
const peaks = pairs.map(() => 0);
film.sighting_pair.forEach((pair, s) => peaks[pair] = Math.max(peaks[pair], film.numbers[s]));
const coloured = [...peaks.keys()].filter(pair => peaks[pair] > 0).sort((a, b) => peaks[b] - peaks[a]).slice(0, HUES.length);
const legend = coloured.map((pair, k) => {
  const mark = element("i"), key = element("span", {className: "key"}, mark, pairs[pair].join(" – "));
  mark.style.background = HUES[k];
  key.onpointerenter = () => hover(pair);
  key.onpointerleave = () => hover(-1);
  key.onclick = () => choose(pair);
  return key;
});
if (pairs.length > coloured.length) legend.push(element("span", {className: "key", textContent: "others are grey"}));

function traceAll() {
  curves = kind.total ? [[]] : pairs.map((_, pair) => Object.assign([], {pair}));
  for (let frame = 0; frame <= last; frame++) {
    let all = 0;
    for (const s of sightings(frame)) {
      const value = measure(s, kind.by);
      if (!kind.total) curves[film.sighting_pair[s]].push([frame, value]);
      all = kind.by === "volume" ? all + value : Math.max(all, value);
    }
    if (kind.total && all) curves[0].push([frame, all]);
  }
  const values = curves.flatMap(curve => curve.map(([, value]) => value)).filter(Boolean);
  largest = values.reduce((a, b) => Math.max(a, b), 0);
  // The smallest value shown: a millionth of the largest is of no interest.
  smallest = 10 ** Math.floor(Math.log10(Math.max(values.reduce((a, b) => Math.min(a, b), largest), largest * 1e-6)));
  unit = kind.by === "depth" ? ["mm", 1e-3] : inUnit(largest, kind.by === "volume" ? units : newtons, 3).slice(1);
  for (const curve of curves) curve.peak = curve.reduce((peak, [, value]) => Math.max(peak, value), 0);
  drawnCurves = curves.filter(curve => curve.length).sort((a, b) => b.peak - a.peak);
  awaitChart();
}

// Draws once before the next picture, however many changes there were.
let awaited = false;
function awaitChart() {
  if (!awaited) requestAnimationFrame(sizeChart);
  awaited = true;
}

function heightOf(value) {
  if (!largest) return 0;
  if (!kind.logarithmic) return value / largest;
  return Math.max(0, Math.log(value / smallest) / (Math.log(largest / smallest) || 1));
}

const inner = {wide: 0, high: 0};  // of the axes, px
function across(frame) {
  return (LEFT + inner.wide * (times[last] ? times[frame] / times[last] : 0)) * devicePixelRatio;
}

function up(value) {
  return (TOP + inner.high * (1 - heightOf(value))) * devicePixelRatio;
}

// A curve falls to the ground where its pair is apart.
function trace(context, curve) {
  context.beginPath();
  let before = -2;
  for (const [k, [frame, value]] of curve.entries()) {
    if (frame !== before + 1) context.moveTo(across(Math.max(frame - 1, 0)), up(frame ? 0 : value));
    context.lineTo(across(frame), up(value));
    before = frame;
    if (frame < last && curve[k + 1]?.[0] !== frame + 1) context.lineTo(across(frame + 1), up(0));
  }
  context.stroke();
}

// Steps of 1, 2 or 5 times a power of ten, about as many as wanted.
function ticks(end, wanted) {
  if (!(end > 0)) return [];
  const rough = end / wanted, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find(each => each * power >= rough * 0.999);
  return Array.from({length: Math.floor(end / step * 1.000001) + 1}, (_, k) => k * step);
}

function valueTicks() {
  if (!kind.logarithmic) return ticks(largest / unit[1], Math.max(chart.clientHeight / 34, 3)).map(each => each * unit[1]);
  const decades = Math.round(Math.log10(largest / smallest) - 0.5), every = Math.ceil((decades + 1) / (chart.clientHeight / 24));
  return largest ? Array.from({length: Math.floor(decades / every) + 1}, (_, k) => smallest * 10 ** (k * every)) : [];
}

function sizeChart() {
  awaited = false;
  if (!chart.clientWidth) return;
  [inner.wide, inner.high] = [chart.clientWidth - LEFT - RIGHT, chart.clientHeight - TOP - BOTTOM];
  const ratio = devicePixelRatio;
  for (const canvas of [chart, background]) [canvas.width, canvas.height] = [chart.clientWidth * ratio, chart.clientHeight * ratio];
  const context = background.getContext("2d", {willReadFrequently: true});  // thousands of lines are faster so
  context.font = `${11 * ratio}px system-ui, sans-serif`;
  context.lineWidth = ratio;
  context.fillStyle = "#a7b0bd";
  context.strokeStyle = "#363d4a";
  const line = (...points) => {
    context.beginPath();
    points.forEach(([x, y], k) => k ? context.lineTo(x, y) : context.moveTo(x, y));
    context.stroke();
  };
  const [left, right, ground] = [LEFT * ratio, chart.width - RIGHT * ratio, chart.height - BOTTOM * ratio];
  context.textAlign = "right";
  context.textBaseline = "middle";
  const levels = valueTicks();
  for (const value of levels) {
    line([left - 4 * ratio, up(value)], [right, up(value)]);
    context.fillText(plain(value / unit[1], 3), left - 7 * ratio, up(value));
  }
  line([left, ground], [right, ground]);
  context.textBaseline = "alphabetic";
  const label = (text, x) => {
    line([x, ground], [x, ground + 4 * ratio]);
    context.fillText(text, x, chart.height - 4 * ratio);
  };
  context.textAlign = "center";
  // Names that would run into each other are left out: the bar above has the name of the frame that is shown.
  let end = -Infinity;
  chart.namesShown = [];
  if (names) names.forEach((name, frame) => {
    const width = context.measureText(name).width, begin = across(frame) - (frame ? width : 0);
    if (begin < end + 12 * ratio) return;
    context.textAlign = frame ? "right" : "left";
    label(name, across(frame));
    end = begin + width;
    chart.namesShown.push(name);
  });
  else for (const time of ticks(times[last], Math.max(chart.clientWidth / 120, 2))) {
    const x = left + (right - left) * time / times[last];
    if (x < right - 58 * ratio) label(plain(time, 4), x);
  }
  context.textAlign = "right";
  if (!names) context.fillText("time, s", right, chart.height - 4 * ratio);
  const title = `${kind.by}${kind.total ? together[kind.by].title : ""}, ${unit[0]}`
    + (drawnCurves.length > CURVES ? `, the ${CURVES} largest of ${drawnCurves.length.toLocaleString("en")} pairs` : "");
  context.textAlign = "left";
  context.fillText(largest ? title : "nothing is shared", left + 5 * ratio, 12 * ratio);
  chart.ariaLabel = largest ? `${title}, over time: up to ${plain(largest / unit[1], 3)}` : "nothing is shared";
  chart.scaleText = levels.map(value => plain(value / unit[1], 3));
  context.strokeStyle = kind.total ? "#e8ebf0" : `#a7b0bd${drawnCurves.length > 100 ? "40" : drawnCurves.length > 20 ? "80" : "d0"}`;
  const few = drawnCurves.slice(0, CURVES), hueOf = curve => kind.total ? undefined : HUES[coloured.indexOf(curve.pair)];
  for (const curve of few.filter(curve => !hueOf(curve))) trace(context, curve);
  context.lineWidth = 1.5 * ratio;
  for (const curve of few.filter(hueOf).reverse()) {
    context.strokeStyle = hueOf(curve);
    trace(context, curve);
  }
  drawChart();
}

function drawChart() {
  if (!chart.clientWidth) return;
  const context = chart.getContext("2d"), ratio = devicePixelRatio;
  context.clearRect(0, 0, chart.width, chart.height);
  context.drawImage(background, 0, 0);
  for (const [pair, color, width] of [[hovered, "#e8ebf0", 2], [chosen, "#ff4fa3", 3]]) {
    if (pair < 0 || kind.total) continue;
    [context.strokeStyle, context.lineWidth] = [color, width * ratio];
    trace(context, curves[pair]);
  }
  if (shown >= 0) {
    context.fillStyle = "#e8ebf0";
    context.fillRect(across(shown) - ratio / 2, 0, ratio, chart.height - BOTTOM * ratio);
  }
  const pair = hovered >= 0 ? hovered : chosen;
  byId("caption").replaceChildren(...(pair >= 0 && !byId("caption").matches(":hover") ? named(pairs[pair]) : kind.total ? [] : legend));
}

// The pair whose curve is nearest to a point of the chart.
function curveAt(x, y) {
  const frame = frameAt(timeAt(x));
  let best = -1, nearest = 12 * devicePixelRatio;
  if (kind.total) return best;
  for (const s of sightings(frame)) {
    const off = Math.abs(up(measure(s, kind.by)) - y * devicePixelRatio);
    if (off < nearest) [best, nearest] = [film.sighting_pair[s], off];
  }
  return best;
}

function timeAt(x) {
  return times[last] * Math.min(Math.max((x - LEFT) / (chart.clientWidth - LEFT - RIGHT), 0), 1);
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
new ResizeObserver(awaitChart).observe(chart);

// Groups of buttons; one of each group is pressed.
function chartOf(change) {
  Object.assign(kind, change);
  const pressed = {"of-volume": kind.by === "volume", "of-depth": kind.by === "depth", "per-pair": !kind.total};
  Object.assign(pressed, {"in-total": kind.total, linear: !kind.logarithmic, logarithmic: kind.logarithmic});
  if (film.forces) pressed["of-force"] = kind.by === "force";
  for (const [id, on] of Object.entries(pressed)) byId(id).ariaPressed = on;
  byId("in-total").textContent = together[kind.by].button;
  traceAll();
}
const changes = {"of-volume": {by: "volume"}, "of-depth": {by: "depth"}, "per-pair": {total: false}, "in-total": {total: true}};
Object.assign(changes, {linear: {logarithmic: false}, logarithmic: {logarithmic: true}});
if (film.forces) changes["of-force"] = {by: "force"};
for (const [id, change] of Object.entries(changes)) byId(id).onclick = () => chartOf(change);
