// The list of overlaps: by pairs of bodies, in these by pairs of links, in these by shapes, each with its totals.

const ROWS = 200, FEW = 12, columns = film.forces ? 3 : 2;
const [rows, heading] = [document.querySelector("#list tbody"), document.querySelector("#list th")];
const opened = new Map();  // whether a group is open, by its key; the others are open if there are few
let most = 0;
for (let frame = 0; frame <= last; frame++) most = Math.max(most, film.sighting_start[frame + 1] - film.sighting_start[frame]);

function isOpen(key) {
  return opened.get(key) ?? most <= FEW;
}

// Lists of sightings by the keys of their pairs, those with most volume in sum first.
function grouped(some, keys) {
  const groups = new Map();
  for (const sighting of some) {
    const key = keys[film.sighting_pair[sighting]];
    if (!groups.has(key)) groups.set(key, {key, sightings: [], volume: 0, depth: 0, forces: [0, 0, 0]});
    const group = groups.get(key);
    group.sightings.push(sighting);
    group.volume += measure(sighting, "volume");
    group.depth = Math.max(group.depth, measure(sighting, "depth"));
    (pressOf(sighting)?.force ?? []).forEach((part, k) => { group.forces[k] += part; });
  }
  for (const group of groups.values()) group.force = Math.hypot(...group.forces);
  return [...groups.values()].sort((a, b) => b.volume - a.volume);
}

// A link is called by its name without the name of its body. A shape has a number if there are several.
function within(name, whole) {
  const rest = [".", "/"].some(mark => name.startsWith(whole + mark)) ? name.slice(whole.length + 1) : name;
  return /^\d+$/.test(rest) ? `part ${rest}` : rest;
}

const linkKeys = links.map(pair => JSON.stringify(pair)), bodyKeys = links.map(pair => JSON.stringify(pair.map(([body]) => body)));
function rowsOf(some) {
  const wanted = [];
  const leaf = (sighting, level, wholes, own = wholes) => {
    const pair = film.sighting_pair[sighting];
    const called = wholes ? pairs[pair].map((name, k) => name === wholes[k] ? own[k] : within(name, wholes[k])) : pairs[pair];
    wanted.push({level, pair, sighting, called, full: pairs[pair], volume: measure(sighting, "volume"), depth: measure(sighting, "depth"), force: measure(sighting, "force")});
  };
  for (const bodies of grouped(some, bodyKeys)) {
    if (bodies.sightings.length === 1) {
      leaf(bodies.sightings[0], 0);
      continue;
    }
    const called = JSON.parse(bodies.key);
    wanted.push({level: 0, group: bodies, called, full: called, ...bodies});
    if (!isOpen(bodies.key)) continue;
    const byLink = grouped(bodies.sightings, linkKeys);
    for (const inner of byLink) {
      const names = JSON.parse(inner.key).map(([, name]) => name);
      if (inner.sightings.length === 1) {
        leaf(inner.sightings[0], 1, called);
      } else if (byLink.length === 1) {
        for (const sighting of largestFirst(inner.sightings)) leaf(sighting, 1, called);
      } else {
        const own = names.map((name, k) => within(name, called[k]));
        wanted.push({level: 1, group: inner, called: own, full: names, ...inner});
        if (isOpen(inner.key)) for (const sighting of largestFirst(inner.sightings)) leaf(sighting, 2, names, own);
      }
    }
  }
  return wanted;
}

function showList(frame) {
  const some = sightings(frame), all = film.sighting_start[frame + 1] - film.sighting_start[frame];
  const plural = count => `${count.toLocaleString("en")} overlap${count === 1 ? "" : "s"}`;
  const total = some.reduce((sum, sighting) => sum + measure(sighting, "volume"), 0);
  heading.textContent = some.length < all ? `${some.length} of ${plural(all)}` : plural(all);
  byId("total").textContent = `${heading.textContent}` + (some.length ? `, ${inUnit(total, units, 3).slice(0, 2).join(" ")}` : "");
  const wanted = rowsOf(some), more = wanted.length - ROWS;
  while (rows.rows.length > Math.min(wanted.length, ROWS)) rows.deleteRow(-1);
  wanted.slice(0, ROWS).forEach((each, k) => fillRow(rows.rows[k] ?? newRow(), each));
  byId("more").hidden = more <= 0;
  byId("more").textContent = `and ${more} more rows: the filter leaves the larger ones`;
}

function fillRow(row, each) {
  const {level, pair = -1, sighting, group, called, full, volume, depth, force} = each;
  Object.assign(row, {pair, sighting, group});
  const button = row.cells[0].firstChild, text = JSON.stringify([called, group?.sightings.length, group && isOpen(group.key)]);
  if (row.text !== text) {
    const mark = element("span", {className: "mark", textContent: group ? isOpen(group.key) ? "▾" : "▸" : ""});
    const number = group ? [element("span", {className: "quiet", textContent: ` × ${group.sightings.length}`})] : [];
    button.replaceChildren(mark, ...named(called), ...number);
    button.title = full.join(" – ") + (group ? ": together, and the deepest" : ": click for its numbers, and to come near; escape to come back");
    if (group) button.setAttribute("aria-expanded", isOpen(group.key));
    else button.removeAttribute("aria-expanded");
    row.text = text;
  }
  row.level = level;
  dressRow(row);
  [told(volume, units, 3), `${plain(1e3 * depth, 3)} mm`, told(force, newtons, 3)].slice(0, columns).forEach((text, i) => {
    if (row.cells[i + 1].textContent !== text) row.cells[i + 1].textContent = text;
  });
}

function dressRow(row) {
  const picked = row.pair >= 0 && row.pair === chosen;
  row.className = `level${row.level} ${picked ? "picked" : row.pair >= 0 && row.pair === hovered ? "hovered" : ""}`;
  row.cells[0].firstChild.ariaCurrent = picked ? "true" : null;
}

function newRow() {
  const row = rows.insertRow();
  for (let i = 0; i <= columns; i++) row.insertCell();
  row.cells[0].append(element("button"));
  row.onclick = () => {
    if (row.group) {
      opened.set(row.group.key, !isOpen(row.group.key));
      showList(shown);
    } else {
      choose(row.pair);
      comeTo(row.sighting);
    }
  };
  row.onmouseenter = () => hover(row.pair);
  row.onmouseleave = () => hover(-1);
  return row;
}

function hover(pair) {
  if (pair === hovered) return;
  hovered = pair;
  for (const row of rows.rows) dressRow(row);
  drawChart();
}

// The next overlap in the order of size, or the one before.
function chooseNext(step) {
  const order = largestFirst(sighted);
  if (!order.length) return;
  const at = order.findIndex(sighting => film.sighting_pair[sighting] === chosen);
  const sighting = order[at < 0 ? 0 : (at + step + order.length) % order.length];
  choose(film.sighting_pair[sighting]);
  comeTo(sighting);
}

const [least, by] = ["least", "by"].map(byId);
const [filterUnit, filterScale] = inUnit(film.numbers.subarray(0, count).reduce((a, b) => Math.max(a, b), 0), units, 3).slice(1);
const scales = {volume: filterScale, depth: 1e-3, force: 1};
by.options[0].textContent = `${filterUnit} volume`;
if (film.forces) {
  by.append(element("option", {value: "force", textContent: "N force"}));
  document.querySelector("#list thead tr").append(element("th", {textContent: "force", scope: "col"}));
}

// Applies the filter, and shows it in its controls.
function leaveOut(kind, smallest) {
  Object.assign(filter, {by: kind, least: smallest > 0 ? smallest : 0});
  by.value = kind;
  if (!(Math.abs(+least.value * scales[kind] - filter.least) <= 1e-9 * filter.least)) least.value = filter.least ? +(filter.least / scales[kind]).toPrecision(9) : "";
  traceAll();
  if (shown < 0) return;
  drawOverlaps(shown);
  showList(shown);
  viewer.set_dirty();
}
least.oninput = by.onchange = () => leaveOut(by.value, +least.value * scales[by.value]);
