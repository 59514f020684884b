// Things in space: meshes, lines and points in layers, to turn and zoom.
"use strict";

// things: [{ layer, kind: "mesh" | "line" | "points", points, triangles, colour | role, text, … }]
async function drawSpace(plot, box, things) {
  const names = [...new Set(things.map((thing) => thing.layer))];
  const layers = names.map((name) => {
    const role = things.find((thing) => thing.layer === name).role || "image";
    return { id: `space-${name}`, label: name, role, on: true, name };
  });
  const isOn = (name) => layers.some((layer) => layer.name === name && layer.on);
  const trace = (thing) => {
    const colour = thing.colour || ROLES[thing.role][darkTheme.matches ? 1 : 0];
    const column = (i) => thing.points.map((p) => p[i]);
    const shared = { x: column(0), y: column(1), z: column(2), hoverinfo: "text",
      hovertext: thing.text, text: thing.text, visible: isOn(thing.layer) };
    if (thing.kind === "mesh") {
      const corner = (i) => thing.triangles.map((t) => t[i]);
      return { type: "mesh3d", ...shared, i: corner(0), j: corner(1), k: corner(2), color: colour,
        opacity: thing.opacity, flatshading: true };
    }
    const mode = thing.kind === "line" ? "lines" : "markers";
    return { type: "scatter3d", ...shared, mode, line: { color: colour, width: thing.width || 4, dash: thing.dash || "solid" },
      marker: { color: colour, size: thing.size || 4, symbol: thing.symbol || "circle" }, connectgaps: false };
  };
  const axis = (name) => ({ title: { text: `${name} [m]` }, color: cssColour("--ink"),
    gridcolor: cssColour("--line"), backgroundcolor: "rgba(0,0,0,0)" });
  // The eye stands back as far as the longest side asks for; Plotly makes the volume 1.
  const sides = [0, 1, 2].map((i) => {
    let [low, high] = [Infinity, -Infinity];
    for (const thing of things) {
      for (const point of thing.points) {
        if (point[i] === null) continue;
        low = Math.min(low, point[i]);
        high = Math.max(high, point[i]);
      }
    }
    return high - low;
  });
  const longest = Math.max(...sides, 1e-9);
  const cube = Math.cbrt(sides.reduce((product, side) => product * Math.max(side, 0.01 * longest), 1));
  const back = Math.max(1, 0.85 * longest / cube);
  const redraw = () => Plotly.react(plot, things.map(trace), {
    ...baseLayout(),
    margin: { l: 0, r: 0, t: 0, b: 0 },
    scene: { aspectmode: "data", xaxis: axis("x"), yaxis: axis("y"), zaxis: axis("z"),
      camera: { eye: { x: 0.9 * back, y: -1.5 * back, z: 0.9 * back } }, uirevision: "kept" },
  }, { ...PLOT_OPTIONS, scrollZoom: !narrow.matches });
  layerSwitches(box, layers, redraw);
  await redraw();
  darkTheme.addEventListener("change", redraw);
  plot.dataset.drawn = "yes";
  return redraw;
}

// Triangles of a convex polygon of n corners.
const fan = (n) => Array.from({ length: n - 2 }, (_, i) => [0, i + 1, i + 2]);

function thingsFound() {
  const things = [];
  const add = (layer, role, kind, points, text, more = {}) => {
    if (points.length) things.push({ layer, role, kind, points, text, ...more });
  };
  for (const mirror of page.mirrors.filter((one) => one.corners)) {
    add("mirrors", "mirror", "mesh", mirror.corners, mirrorText(mirror),
      { triangles: fan(mirror.corners.length), opacity: 0.35 });
    add("mirrors", "mirror", "line", closed(mirror.corners), mirrorText(mirror));
  }
  add("targets", "target", "points", page.targets.map((one) => one.position), page.targets.map(targetText), { symbol: "square" });
  for (const user of page.users.filter((one) => one.position)) {
    if (user.path) add("paths", "path", "line", user.path, `path of ${plainText(user.name)}`);
    add("users", "user", "points", [user.position], userText(user), { size: 6 });
  }
  const { truth } = page;
  const named = (list) => list.map((one) => `truth: ${plainText(one.name)}<br>${placeText(one.position)}`);
  for (const wall of truth.walls) add("truth", "truth", "line", wall.line, `truth: ${plainText(wall.name)}`, { width: 6 });
  add("truth", "truth", "points", truth.users.map((one) => one.position), named(truth.users), { symbol: "circle-open", size: 9 });
  add("truth", "truth", "points", truth.targets.map((one) => one.position), named(truth.targets), { symbol: "diamond-open", size: 6 });
  add("array", "array", "points", page.array, "array", { size: 2 });
  return things;
}

// In space as in the plan: the paths of the user that is moved there.
async function drawFound() {
  const rays = { layer: "predicted paths", role: "predicted", kind: "line", points: [], text: "predicted", dash: "dash" };
  const things = page.prediction ? [...thingsFound(), rays] : thingsFound();
  let [redraw, drawing, stale] = [null, false, false];
  document.getElementById("plan-plot").addEventListener("moveduser", async (event) => {
    rays.points = event.detail.paths.flatMap((path) => [...path.vertices, [null, null, null]]);
    stale = true;
    if (!redraw || drawing) return;
    drawing = true; // one at a time, however fast it is dragged, and the last one surely
    while (stale) {
      stale = false;
      await redraw();
    }
    drawing = false;
  });
  redraw = await drawSpace(document.getElementById("space-plot"), document.getElementById("space-layers"), things);
}
