// The page: mouse, keys and forms to requests; answers to the picture and to words.
import { View } from "/canvas.js";

const $ = (id) => document.getElementById(id);
const view = new View($("canvas"));
const RETRY = 1000;       // time between two attempts to connect [ms]
const REST = 150;         // time without a change after which the mouse is at rest [ms]
const MOST_WAITING = 2;   // number of requests without an answer
const STROKE = 60;        // time between two parts of a stroke that are sent [ms]
const STORE = "dubins_rrt play";

let socket = null, options = null, changed = {}, tool = "move", held = null, restTimer = 0;
let number = 0, dirty = null, sent = new Map(), times = [], lastFiles = [], firstOf = 0;
let lastVia = "[]";       // the waypoints that came last, of a node's goal
let isWatching = false;   // the page of `dubins_rrt watch`: a node plans, and what is dragged is sent when it is let go

// What tests and the curious may read: the number of answers, and the times from mouse to picture [ms].
const counts = window.dubins = { answers: 0, pictures: 0, latencies: [], view };

function connect() {
  socket = new WebSocket(`ws://${location.host}/socket${location.search}`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { $("lost").hidden = true; sent.clear(); };
  socket.onmessage = (event) => receive(event.data);
  socket.onclose = () => { $("lost").hidden = false; setTimeout(connect, RETRY); };
}

function send(message) {
  if (socket && socket.readyState === WebSocket.OPEN) { socket.send(JSON.stringify(message)); return true; }
  return false;
}

// Requests. While something moves they are quick; at rest the search goes on.

function ask(quick) {
  if (isWatching) { return; }
  dirty = { quick };
  flush();
  clearTimeout(restTimer);
  if (quick) { restTimer = setTimeout(() => ask(false), REST); }
  remember();
}

function flush() {
  if (!dirty || !options || sent.size >= MOST_WAITING) { return; }
  const message = { type: "plan", id: ++number, start: view.start, goal: view.goal, via: view.via, quick: dirty.quick, ...chosen() };
  if (send(message)) { sent.set(number, performance.now()); dirty = null; }
}

function chosen() {
  const vehicle = { turning_radius: Number($("turning_radius").value) };
  if ($("shape").value === "car") {
    const [ahead, behind, width] = ["ahead", "behind", "width"].map((id) => Number($(id).value));
    vehicle.footprint = JSON.stringify([[ahead, width / 2], [-behind, width / 2], [-behind, -width / 2], [ahead, -width / 2]]);
  } else {
    vehicle.robot_radius = Number($("robot_radius").value);
  }
  return { vehicle, settings: changed.settings || {}, problem: changed.problem || {} };
}

// Answers.

const receivers = {
  hello(message) {
    options = message.options;
    isWatching = message.watch === true;
    document.body.classList.toggle("watching", isWatching);
    if (isWatching && !view.map) { view.unsent = new Set(["start", "goal"]); }
    document.title = `dubins_rrt ${isWatching ? "watch" : "play"}`;
    $("command").textContent = document.title;
    if (isWatching) { options.settings = [...options.vehicle, ...options.settings]; changed = {}; }
    showFiles(message.files);
    makeSettings();
  },
  map(message) {
    const known = recall(), isFirst = view.map === null;
    view.setMap(message);
    view.stroke = null;
    $("title").textContent = message.name;
    if (isWatching) {
      for (const name of view.unsent) { view[name] = message[name]; }
      if (isFirst || message.new) { view.fit(); }
      return;
    }
    if (message.new) {
      [view.start, view.goal] = known && known.map === message.name ? [known.start, known.goal] : [message.start, message.goal];
      view.via = known && known.map === message.name && known.via ? known.via : [];
      view.answer = view.first = view.tree = null;
      view.fit();
    }
    ask(false);
  },
  answer(message) {
    const poses = [];
    for (let i = 0; i < message.path.length; i += 3) { poses.push(message.path.slice(i, i + 3)); }
    message.poses = poses;
    if (message.quick || message.id !== firstOf) { view.first = poses.length ? poses : null; }
    firstOf = message.id;
    view.answer = message;
    view.request();
    counts.answers++;
    times.push(performance.now());
    if (message.final) {
      const began = sent.get(message.id);
      if (message.quick && began) { view.onDrawn = () => { counts.pictures++; counts.latencies.push(performance.now() - began); view.onDrawn = null; }; }
      for (const id of [...sent.keys()]) { if (id <= message.id) { sent.delete(id); } }
      flush();
    }
    showFigures(message);
  },
  poses(message) {
    if (held) { return; }
    for (const name of ["start", "goal"].filter((name) => message[name])) {
      view[name] = message[name];
      view.unsent.delete(name);
    }
    const via = JSON.stringify(message.via);  // what was added on the page stays until a goal with others comes
    if (via !== lastVia) { lastVia = via; view.via = message.via; }
    view.request();
  },
  parameters({ values }) {
    changed = { settings: values, problem: values };
    const corners = values.footprint ? JSON.parse(values.footprint) : [];
    view.vehicle = { footprint: corners, radius: values.robot_radius };
    if (!$("settings").contains(document.activeElement)) { makeSettings(); }
    view.request();
  },
  refused(message) { sent.clear(); $("note").textContent = message.message; flush(); },
  saved(message) { showFiles(message.files); $("note").textContent = `Saved as ${message.name}.`; },
  copy(message) {
    $("copied").hidden = false;
    $("copied").value = message.text;
    const done = (note) => { $("note").textContent = [note, message.note].filter(Boolean).join(" "); };
    navigator.clipboard.writeText(message.text).then(() => done(`Copied as ${message.as}.`), () => done("Copy it from the field above."));
  },
};

function receive(data) {
  if (typeof data !== "string") {
    view.tree = new Float32Array(data).subarray(1);
    view.request();
    return;
  }
  const message = JSON.parse(data);
  if (message.type !== "refused" && message.type === "answer") { $("note").textContent = ""; }
  receivers[message.type](message);
}

function showFigures(answer) {
  const metres = (value) => (value === null || value === undefined ? "–" : `${value.toFixed(2)} m`), time = (value) => (value === null ? "–" : value < 1 ? `${(1000 * value).toFixed(1)} ms` : `${value.toFixed(2)} s`);
  const percent = answer.gap === null ? "–" : `${(100 * answer.gap).toFixed(1)} %`;
  const reason = ["", "NONE"].includes(answer.status) ? " yet" : `: ${answer.status}`;
  $("title").textContent = answer.length === null ? `No path${reason}` : `Path of ${answer.length.toFixed(2)} m`;
  $("message").textContent = answer.length === null ? answer.message : "";
  const rows = [["no path is shorter than", metres(answer.lower_bound)], ["at most longer by", percent],
                ["room to the walls", metres(answer.min_clearance)], ["first path", answer.first_length ? `${metres(answer.first_length)} after ${time(answer.time_to_first)}` : time(answer.time_to_first)],
                ["samples, tree nodes", `${answer.samples}, ${answer.tree_nodes}`], ["planned in", time(answer.planning_time)]];
  $("figures").replaceChildren(...(answer.length === null ? [] : rows).flatMap(([name, value]) => [element("dt", name), element("dd", value)]));
}

function element(kind, text) {
  const made = document.createElement(kind);
  made.textContent = text;
  return made;
}

setInterval(() => {
  const now = performance.now();
  times = times.filter((time) => now - time < 1000);
  const sorted = counts.latencies.slice(-1000).sort((a, b) => a - b);
  const late = sorted.length ? `; from mouse to picture ${sorted[Math.floor(0.99 * (sorted.length - 1))].toFixed(0)} ms in 99 of 100` : "";
  $("pace").textContent = `${times.length} answer${times.length === 1 ? "" : "s"} in the last second${late}`;
}, 500);

// Files and settings.

function showFiles(files) {
  lastFiles = files;
  $("files").replaceChildren(element("option", "choose a map"), ...files.map((name) => element("option", name)));
}

$("files").onchange = () => {
  const name = $("files").value;
  if (!lastFiles.includes(name)) { return; }
  const picture = /\.(png|pgm|bmp)$/i.test(name);
  send({ type: "load", name, ...(picture ? { resolution: Number($("resolution").value) } : {}) });
};
$("save").onclick = () => send({ type: "save", name: $("save-name").value });

function makeSettings() {
  const hidden = new Set(["path_spacing"]);
  const fields = ["settings", "problem"].flatMap((group) => options[group].filter((item) => !hidden.has(item.name)).map((item) => setting(group, item)));
  $("settings").replaceChildren(...fields);
}

function setting(group, item) {
  const label = document.createElement("label"), kept = (changed[group] || {})[item.name];
  label.title = item.help;
  let input;
  if (item.choices.length) {
    input = document.createElement("select");
    input.append(...item.choices.map((choice) => element("option", choice)));
  } else {
    input = document.createElement("input");
    input.type = item.type === "bool" ? "checkbox" : item.type === "str" ? "text" : "number";
    if (input.type === "number") { Object.assign(input, { min: item.low, max: item.high, step: item.type === "int" ? 1 : "any" }); }
  }
  const value = kept === undefined ? item.default : kept;
  if (input.type === "checkbox") { input.checked = value; } else { input.value = value; }
  input.id = item.name;
  input.onchange = () => {
    const now = input.type === "checkbox" ? input.checked : input.type === "number" ? Number(input.value) : input.value;
    if (isWatching) { send({ type: "set", name: item.name, value: now }); return; }
    changed[group] = { ...changed[group], [item.name]: now };
    if (now === item.default) { delete changed[group][item.name]; }
    ask(false);
  };
  label.append(`${item.name.replaceAll("_", " ")}${item.unit ? ` [${item.unit}]` : ""} `, input);
  return label;
}

function showVehicle() {
  const car = $("shape").value === "car", { vehicle } = chosen();
  $("disc").hidden = car;
  $("car").hidden = !car;
  view.vehicle = { footprint: car ? JSON.parse(vehicle.footprint) : [], radius: car ? Number($("width").value) / 2 : vehicle.robot_radius };
  for (const slider of document.querySelectorAll("aside label input[type=range]")) { slider.nextElementSibling.textContent = `${Number(slider.value).toFixed(2)} m`; }
  view.request();
}

for (const id of ["turning_radius", "robot_radius", "shape", "ahead", "behind", "width", "brush"]) {
  $(id).oninput = () => { showVehicle(); if (id !== "brush") { ask(true); } };
}
for (const button of document.querySelectorAll("[data-copy]")) { button.onclick = () => send({ type: "copy", as: button.dataset.copy }); }
for (const button of document.querySelectorAll("[data-tool]")) {
  button.onclick = () => {
    tool = button.dataset.tool;
    for (const other of document.querySelectorAll("[data-tool]")) { other.setAttribute("aria-pressed", String(other === button)); }
    $("brushes").hidden = !["draw", "erase"].includes(tool);
  };
}
$("drive").onclick = () => view.drive();
$("cancel").onclick = () => send({ type: "cancel" });
$("fit").onclick = () => view.fit();

// Mouse and touch.

const place = (event) => [event.offsetX, event.offsetY];

$("canvas").onpointerdown = (event) => {
  $("canvas").setPointerCapture(event.pointerId);
  const [x, y] = place(event);
  if (event.button !== 0) { held = { kind: "pan", x, y }; return; }
  if (tool === "via") {
    const number = view.pickWaypoint(x, y);
    held = { kind: "via", number, isNew: number < 0, x, y };
    if (number < 0) { view.via.push(view.toWorld(x, y)); held.number = view.via.length - 1; ask(true); view.request(); }
    return;
  }
  if (tool !== "move") {
    held = { kind: "stroke" };
    view.stroke = { points: [view.toWorld(x, y)], obstacle: tool === "draw", radius: Number($("brush").value), from: 0, last: 0 };
    view.request();
    return;
  }
  const picked = view.pick(x, y) || ["goal", "place"];
  held = { kind: picked[1], name: picked[0], offset: [0, 0] };
  view.selected = held.name;
  const pose = view[held.name], [wx, wy] = view.toWorld(x, y);
  if (held.kind === "move") { held.offset = [pose[0] - wx, pose[1] - wy]; }
  if (held.kind === "place") { setPose(held.name, [wx, wy, pose[2]]); }
  view.request();
};

$("canvas").onpointermove = (event) => {
  if (!held) { return; }
  const [x, y] = place(event), [wx, wy] = view.toWorld(x, y);
  if (held.kind === "pan") { view.pan(x - held.x, y - held.y); [held.x, held.y] = [x, y]; return; }
  if (held.kind === "stroke") { view.stroke.points.push([wx, wy]); sendStroke(false); view.request(); return; }
  if (held.kind === "via") {
    held.moved = held.moved || Math.hypot(x - held.x, y - held.y) > 4;
    if (held.moved) { view.via[held.number] = [wx, wy]; view.request(); ask(true); }
    return;
  }
  const pose = view[held.name];
  if (held.kind === "move") { setPose(held.name, [wx + held.offset[0], wy + held.offset[1], pose[2]]); return; }
  if (Math.hypot(wx - pose[0], wy - pose[1]) * view.scale > 6) { setPose(held.name, [pose[0], pose[1], Math.atan2(wy - pose[1], wx - pose[0])]); }
};

$("canvas").onpointerup = $("canvas").onpointercancel = () => {
  if (held && held.kind === "via" && !held.isNew && !held.moved) { view.via.splice(held.number, 1); view.request(); }
  if (held && held.kind === "stroke") { sendStroke(true); }
  else if (held && held.kind !== "pan") { if (isWatching) { sendPose(held.name || "goal"); } else { ask(false); } }
  held = null;
};

$("canvas").oncontextmenu = (event) => event.preventDefault();
$("canvas").ondblclick = () => view.fit();
$("canvas").addEventListener("wheel", (event) => { event.preventDefault(); view.zoom(Math.exp(-event.deltaY / 400), ...place(event)); }, { passive: false });

function sendPose(name) { send({ type: "pose", name, pose: view[name], via: view.via }); }

function setPose(name, pose) {
  view[name] = pose;
  view.request();
  ask(true);
}

// Send what was drawn since the last time, so that the path gives way while one draws.
function sendStroke(done) {
  const stroke = view.stroke, now = performance.now();
  if (!done && now - stroke.last < STROKE) { return; }
  stroke.last = now;
  const points = stroke.points.slice(Math.max(0, stroke.from - 1));
  stroke.from = stroke.points.length;
  send({ type: "draw", points, radius: stroke.radius, obstacle: stroke.obstacle, done });
  if (!done) { ask(true); }
}

// Keys.

$("canvas").onkeydown = (event) => {
  const step = (event.shiftKey ? 20 : 4) / view.scale, turn = event.shiftKey ? Math.PI / 8 : Math.PI / 64, middle = [$("canvas").clientWidth / 2, $("canvas").clientHeight / 2];
  const moves = { ArrowLeft: [-step, 0, 0], ArrowRight: [step, 0, 0], ArrowUp: [0, step, 0], ArrowDown: [0, -step, 0], q: [0, 0, turn], e: [0, 0, -turn] };
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (moves[key]) { const pose = view[view.selected]; setPose(view.selected, pose.map((value, i) => value + moves[key][i])); }
  else if (key === "s" || key === "g") { view.selected = key === "s" ? "start" : "goal"; view.request(); }
  else if (key === "+" || key === "-") { view.zoom(key === "+" ? 1.25 : 0.8, ...middle); }
  else if (key === "0") { view.fit(); }
  else if (key === "Enter" && isWatching) { sendPose(view.selected); }
  else { return; }
  event.preventDefault();
};

// What survives a reload.

function remember() {
  const form = Object.fromEntries(["turning_radius", "shape", "robot_radius", "ahead", "behind", "width"].map((id) => [id, $(id).value]));
  if (view.map && !isWatching) { sessionStorage.setItem(STORE, JSON.stringify({ map: view.map.name, start: view.start, goal: view.goal, via: view.via, form, changed })); }
}

function recall() {
  try { return JSON.parse(sessionStorage.getItem(STORE)); } catch { return null; }
}

const before = recall();
if (before) {
  changed = before.changed;
  for (const [id, value] of Object.entries(before.form)) { $(id).value = value; }
}
showVehicle();
connect();
