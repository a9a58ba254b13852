// Chooses the frame: slider, keys and address. Everything shown belongs to one frame.

function frameAt(time) {
  return Math.max(lastUpTo(times, time), 0);
}

let playing = false, clock = 0, before = 0;

function show(frame) {
  if (frame === shown) return;
  shown = frame;
  poseBodies(frame);
  drawOverlaps(frame);
  showList(frame);
  showNumbers(frame);
  drawChart();
  slider.value = times[frame];
  output.textContent = names ? names[frame] : times[frame].toFixed(3) + " s";
  slider.setAttribute("aria-valuetext", output.textContent);
  viewer.set_dirty();
}

function run(wanted) {
  playing = wanted && !names && last > 0;
  play.textContent = playing ? "❚❚" : "▶";
  play.ariaLabel = playing ? "pause" : "play";
}

function pauseAt(frame) {
  run(false);
  clock = times[frame];
  show(frame);
}

function tick(now) {
  if (playing) {
    clock += (now - before) / 1000 * +speed.value;
    if (clock >= end) clock %= end;
    show(frameAt(clock));
  }
  before = now;
  requestAnimationFrame(tick);
}

slider.max = times[last];
slider.oninput = () => pauseAt(frameAt(+slider.value));
play.onclick = () => run(!playing);
play.hidden = speed.hidden = names !== null;
byId("time").hidden = last === 0;  // there is a single moment

const keys = {
  " ": ["play or pause", () => run(!playing)],
  ArrowLeft: ["one frame back", () => pauseAt(Math.max(shown - 1, 0)), "←"],
  ArrowRight: ["one frame on", () => pauseAt(Math.min(shown + 1, last)), "→"],
  Home: ["to the first frame", () => pauseAt(0)],
  End: ["to the last frame", () => pauseAt(last)],
  n: ["come near the largest overlap, then the next one", () => chooseNext(1)],
  p: ["the one before", () => chooseNext(-1)],
  w: ["the whole scene, and back", byId("whole").onclick],
  Escape: ["back to what moves and what overlaps, nothing chosen", () => {
    choose(-1);
    lookAt("opening");
  }],
  o: ["panel of overlaps", () => showPanel("overlaps")],
  b: ["panel of bodies", () => showPanel("bodies")],
  l: ["panel of looks", () => showPanel("look")],
  d: [`chart of volumes${film.forces ? ", depths or forces" : " or depths"}`, () => chartOf({by: charted[(charted.indexOf(kind.by) + 1) % charted.length]})],
  t: ["chart of pairs or of all together", () => chartOf({total: !kind.total})],
  g: ["chart linear or logarithmic", () => chartOf({logarithmic: !kind.logarithmic})],
  c: ["copy the link to this moment, seen from here", copyLink],
  ...film.forces ? {a: ["forces: pressures and arrows", () => {
    looks.overlaps.forces = !looks.overlaps.forces;
    renew();
  }]} : {},
  r: ["looks as they were", () => {
    for (const kind of kinds) Object.assign(looks[kind], film.looks[kind]);
    renew();
  }],
  "?": ["these keys", byId("help").onclick],
};
for (const name of ["faces", "edges", "vertices", "marks"]) {
  for (const [key, kind] of [[name[0], "overlaps"], [name[0].toUpperCase(), "bodies"]]) {
    if (name === "marks" && kind === "bodies") continue;
    keys[key] = [`${name} of ${kind}`, () => {
      looks[kind][name] = !looks[kind][name];
      renew();
    }];
  }
}
for (const [key, [what, , sign]] of Object.entries(keys)) {
  const row = document.querySelector("#keys table").insertRow();
  row.insertCell().append(element("kbd", {textContent: sign ?? (key === " " ? "space" : key === "Escape" ? "esc" : key)}));
  row.insertCell().textContent = what;
}
document.onkeydown = event => {
  if (event.ctrlKey || event.metaKey || event.altKey || byId("keys").open || !Object.hasOwn(keys, event.key)) return;
  // Controls keep their own keys.
  const target = event.target.closest?.("input, select, button, summary");
  if (target?.matches("select, input[type=number]") && event.key !== "Escape") return;
  if (target && target !== slider && (event.key === " " || target.type === "range" && /^(Arrow|Home|End)/.test(event.key))) return;
  event.preventDefault();
  keys[event.key][1]();
};
// Without this, the space bar would press once more what the mouse clicked last.
document.addEventListener("click", event => {
  if (event.detail) document.activeElement?.closest("button, summary, input[type=checkbox]")?.blur();
});

// Follows the address, also in a page that is open already.
function follow() {
  const wanted = new URLSearchParams(location.hash.slice(1));
  const by = Object.keys(scales).find(each => wanted.has(each)) ?? "volume";
  leaveOut(by, +wanted.get(by));
  if (wanted.has("from")) look(...["from", "at"].map(name => onPage(wanted.get(name).split(",").map(Number))));
  else lookAt(wanted.has("pair") ? "whole" : "opening");  // the pair may be far from the main overlap
  pauseAt(wanted.has("t") ? frameAt(+wanted.get("t")) : film.moment);
  choose(pairs.findIndex(pair => pair.join(",") === wanted.get("pair")));
}

chartOf({});
renew();
follow();
window.onhashchange = follow;
requestAnimationFrame(now => {
  before = now;
  tick(now);
});
// The packed data has checksums, so all of it was read.
byId("unread").remove();
