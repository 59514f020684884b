// The plan of a result: images, what was found, and a user that is dragged.
"use strict";

const PLAN_LAYERS = [
  ["raw", "raw image", null, false], ["corrected", "corrected image", null, true],
  ["truth", "truth", "truth", true], ["mirrors", "mirrors", "mirror", true],
  ["targets", "targets", "target", true], ["paths", "paths", "path", true],
  ["ellipses", "95 % ellipses", "user", true], ["users", "users", "user", true],
  ["alternatives", "alternatives", "user", true], ["predicted", "predicted paths", "predicted", true],
];

// Lists of points as one trace, with gaps between.
function brokenLines(lines) {
  const points = lines.flatMap((line) => [...line, [null, null, null]]);
  return { x: points.map((p) => p[0]), y: points.map((p) => p[1]) };
}

const middle = (line) => line[0].map((_, i) => line.reduce((sum, p) => sum + p[i], 0) / line.length);
const closed = (line) => [...line, line[0]];

function mirrorText(mirror) {
  const seen = mirror.seen_through.length ? `<br>seen through ${mirror.seen_through.join(", ")}` : "";
  const level = mirror.level_db === null ? "" : `<br>${mirror.level_db.toFixed(1)} dB over the background`;
  return `${plainText(mirror.name)}${level}<br>offset ± ${millimetres(mirror.offset_deviation_m)}` +
    `<br>confidence ${fixed(mirror.confidence, 3)}${seen}`;
}

function targetText(target) {
  const level = target.level_db === null ? "" : `<br>${target.level_db.toFixed(1)} dB over a unit point`;
  return `${plainText(target.name)}<br>${placeText(target.position)}${level}`;
}

function userText(user) {
  const spread = user.deviation_m === null ? "" : `<br>± ${millimetres(user.deviation_m)}`;
  return `${plainText(user.name)}: ${plainText(user.status)}<br>${placeText(user.position)}${spread}`;
}

function imageTrace(image) {
  const { x, y } = image.axes;
  const z = Array.from(y, (_, row) => Array.from(x, (_, column) => image.decibels[image.codes[row * x.length + column]]));
  return {
    type: "heatmap", x, y, z, zmin: image.floor, zmax: 0, zsmooth: "fast", colorscale: MAGMA,
    hovertemplate: "x %{x:.4f} m<br>y %{y:.4f} m<br>%{z:.1f} dB below the peak<extra></extra>",
    hoverongaps: false, connectgaps: false,
  };
}

// Traces with the layer and the role that colours them.
function planTraces(images) {
  const traces = [];
  const add = (layer, role, trace) => traces.push({ layer, role, trace });
  for (const [name, image] of Object.entries(images)) add(name, null, imageTrace(image));
  const lines = (layer, role, list, style, width) => {
    if (list.length) {
      add(layer, role, { type: "scatter", mode: "lines", hoverinfo: "skip", ...brokenLines(list),
        line: { width, dash: style } });
    }
  };
  const points = (layer, role, list, symbol, text, size, mode = "markers") => {
    if (list.length) {
      add(layer, role, { type: "scatter", mode, x: list.map((p) => p[0]), y: list.map((p) => p[1]),
        hovertext: text, hoverinfo: "text", marker: { symbol, size, line: { width: 2 } } });
    }
  };
  const { truth } = page;
  lines("truth", "truth", truth.walls.map((wall) => wall.line), "solid", 6);
  if (truth.walls.length) traces[traces.length - 1].trace.opacity = 0.45;
  points("truth", "truth", truth.walls.map((wall) => middle(wall.line)), "line-ns",
    truth.walls.map((wall) => `truth: ${plainText(wall.name)}`), 4);
  points("truth", "truth", truth.users.map((one) => one.position), "circle-open",
    truth.users.map((one) => `truth: ${plainText(one.name)}<br>${placeText(one.position)}`), 15);
  points("truth", "truth", truth.targets.map((one) => one.position), "diamond-open",
    truth.targets.map((one) => `truth: ${plainText(one.name)}<br>${placeText(one.position)}`), 12);
  const outlines = page.mirrors.map((mirror) => (mirror.corners ? closed(mirror.corners) : mirror.line));
  lines("mirrors", "mirror", outlines, "dash", 2.5);
  page.mirrors.forEach((mirror) => { // some points along it, so that the pointer finds it
    const [a, b] = mirror.line;
    const between = [0, 0.25, 0.5, 0.75, 1].map((t) => a.map((value, i) => value + t * (b[i] - value)));
    points("mirrors", "mirror", between, "circle", between.map(() => mirrorText(mirror)), 4);
  });
  lines("targets", "target", page.targets.filter((one) => one.ends).map((one) => one.ends), "solid", 2);
  points("targets", "target", page.targets.map((one) => one.position), "square-open",
    page.targets.map(targetText), 10);
  const found = page.users.filter((user) => user.position);
  const others = page.users.flatMap((user) => user.alternatives.filter((one) => one.position));
  lines("paths", "path", found.filter((user) => user.path).map((user) => user.path), "solid", 2);
  lines("ellipses", "user", [...found, ...others].filter((one) => one.ellipse).map((one) => one.ellipse), "solid", 1.5);
  lines("ellipses", "target", page.targets.filter((one) => one.ellipse).map((one) => one.ellipse), "solid", 1);
  points("users", "user", found.map((user) => user.position), "circle", found.map(userText), 10);
  points("alternatives", "user", others.map((user) => user.position), "circle-open", others.map(userText), 10);
  add("array", "array", { type: "scatter", mode: "markers", x: page.array.map((p) => p[0]),
    y: page.array.map((p) => p[1]), hovertext: "array", hoverinfo: "text", marker: { size: 5, symbol: "square" } });
  return traces;
}

function coloured(trace, role, dark) {
  if (!role) return trace;
  const colour = ROLES[role][dark ? 1 : 0];
  return {
    ...trace,
    ...(trace.line ? { line: { ...trace.line, color: colour } } : {}),
    ...(trace.marker ? { marker: { ...trace.marker, color: colour, line: { ...trace.marker.line, color: colour } } } : {}),
  };
}

async function drawPlan() {
  const plot = document.getElementById("plan-plot");
  const images = {};
  for (const [name, coded] of Object.entries(page.images)) images[name] = await decodedLevels(coded);
  const all = planTraces(images);
  const held = new Set([...all.map((one) => one.layer), ...(page.prediction ? ["predicted"] : [])]);
  const layers = PLAN_LAYERS.filter(([id]) => held.has(id)).map(([id, label, role, on]) => (
    { id, label, role, on, instead: role ? null : "image" }));
  if (!held.has("corrected") && held.has("raw")) layers[0].on = true;
  const isOn = (id) => !layers.some((layer) => layer.id === id && !layer.on);
  const deepest = document.getElementById("plan-floor");
  const shown = () => {
    const black = ["raw", "corrected"].some((name) => held.has(name) && isOn(name));
    const dark = black || darkTheme.matches;
    const layout = { ...baseLayout(), ...planAxes(page.view.x, page.view.y, ["x", "y"], black), hovermode: "closest", dragmode: "pan" };
    if (black) layout.plot_bgcolor = "#000004";
    layout.shapes = moved ? moved.shapes(dark) : [];
    const data = all.map(({ layer, role, trace }) => {
      const drawn = coloured(trace, role, dark);
      const image = role ? {} : { zmin: Number(deepest.value), colorbar: levelBar() };
      return { ...drawn, ...image, visible: isOn(layer) };
    });
    return { data, layout };
  };
  const redraw = () => {
    const { data, layout } = shown();
    return Plotly.react(plot, data, layout, PLOT_OPTIONS);
  };
  const moved = page.prediction ? movedUser(plot, () => shown().layout, () => isOn("predicted")) : null;
  layerSwitches(document.getElementById("plan-layers"), layers, redraw);
  deepest.addEventListener("input", () => {
    document.getElementById("plan-floor-text").textContent = `${deepest.value} dB`;
    redraw();
  });
  if (!Object.keys(page.images).length) document.getElementById("plan-floor-box").hidden = true;
  const zoom = document.getElementById("plan-zoom");
  const range = (x, y) => Plotly.relayout(plot, { "xaxis.range": x, "yaxis.range": y });
  button(zoom, "whole plan", () => range([...page.view.x], [...page.view.y]));
  for (const user of page.users.filter((one) => one.position)) {
    const half = Math.max(6 * (user.deviation_m || 0), 0.005);
    const [x, y] = user.position;
    button(zoom, `zoom to ${user.name}`, () => range([x - half, x + half], [y - half, y + half]));
  }
  await redraw();
  if (moved) moved.begin();
  for (const query of [darkTheme, narrow]) query.addEventListener("change", redraw);
  plot.dataset.drawn = "yes";
}
