// What frame is shown: slider, keys and address. A frame is shown as a whole, so that nothing is of another.

function frameAt(time) {
  return Math.max(lastUpTo(times, time), 0);
}

let playing = false, clock = 0, before = 0;

function show(frame) {
  if (frame === shown) return;
  shown = frame;
  poseBodies(frame);
  drawOverlaps(frame);
  showTable(frame);
  showNumbers(frame);
  drawChart();
  slider.value = times[frame];
  output.textContent = times[frame].toFixed(3) + " s";
  viewer.set_dirty();
}

function run(wanted) {
  playing = wanted;
  play.textContent = playing ? "❚❚" : "▶";
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
play.onclick = () => {
  play.blur();  // or the space bar would press it once more
  run(!playing);
};
speed.onchange = () => speed.blur();
const keys = {
  " ": () => run(!playing),
  Escape: () => {
    choose(-1);
    lookAt("opening");
  },
  w: () => lookAt("whole"),
  ArrowLeft: () => pauseAt(Math.max(shown - 1, 0)),
  ArrowRight: () => pauseAt(Math.min(shown + 1, last)),
  r: () => {
    for (const kind of ["bodies", "overlaps"]) Object.assign(looks[kind], film.looks[kind]);
    renew();
  },
};
for (const name of ["faces", "edges", "vertices", "marks"]) {
  for (const [key, kind] of [[name[0], "overlaps"], [name[0].toUpperCase(), "bodies"]]) {
    keys[key] = () => {
      looks[kind][name] = !looks[kind][name];
      renew();
    };
  }
}
document.onkeydown = event => {
  if (event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return;
  // The panel's own controls keep what the keyboard does with them.
  if (event.target.closest?.("#look") && (event.key === " " || event.key.startsWith("Arrow"))) return;
  event.preventDefault();
  keys[event.key]();
};

// What the address asks for; also of a page that is open already.
function follow() {
  const wanted = new URLSearchParams(location.hash.slice(1));
  if (wanted.has("from")) look(...["from", "at"].map(name => onPage(wanted.get(name).split(",").map(Number))));
  else lookAt("opening");
  pauseAt(wanted.has("t") ? frameAt(+wanted.get("t")) : film.moment);
  choose(pairs.findIndex(pair => pair.join(",") === wanted.get("pair")));
}

renew();
follow();
window.onhashchange = follow;
requestAnimationFrame(now => {
  before = now;
  tick(now);
});
// What is packed has checksums: all of it was read, and nothing is missing.
byId("unread").remove();
