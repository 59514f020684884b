// A user that is put anywhere in the plan, with the paths that the map found implies for it.
"use strict";

const GRASP = 24; // distance within which the pointer takes the user [pixel]
const STILL = 5; // of a click, not a drag [pixel]

function movedUser(plot, layout, isOn) {
  const map = page.prediction;
  const first = page.users.find((user) => user.position);
  let place = first ? [...first.position] : null;
  let paths = [];
  let grasped = false;
  let pressed = null;
  let waiting = false;
  const height = document.getElementById("moved-height");

  const axis = (name) => plot._fullLayout[name];
  const inPlan = (event) => {
    const frame = plot.getBoundingClientRect();
    const [x, y] = [axis("xaxis"), axis("yaxis")];
    const right = (event.clientX - frame.left - x._offset) / x._length;
    const up = 1 - (event.clientY - frame.top - y._offset) / y._length;
    if (right < 0 || right > 1 || up < 0 || up > 1) return null;
    return [x.range[0] + right * (x.range[1] - x.range[0]), y.range[0] + up * (y.range[1] - y.range[0])];
  };
  const pixels = () => {
    const frame = plot.getBoundingClientRect();
    const [x, y] = [axis("xaxis"), axis("yaxis")];
    return [
      frame.left + x._offset + x._length * (place[0] - x.range[0]) / (x.range[1] - x.range[0]),
      frame.top + y._offset + y._length * (1 - (place[1] - y.range[0]) / (y.range[1] - y.range[0])),
    ];
  };
  const near = (event) => {
    if (!place) return false;
    const [x, y] = pixels();
    return Math.hypot(event.clientX - x, event.clientY - y) < GRASP;
  };

  const shapes = (dark) => {
    if (!place || !isOn()) return [];
    const colour = ROLES.predicted[dark ? 1 : 0];
    const strongest = paths.length ? paths[0].level_db : 0;
    const rays = paths.map((path) => ({
      type: "path", layer: "above",
      path: path.vertices.map((p, i) => `${i ? "L" : "M"}${p[0]},${p[1]}`).join(""),
      line: { color: colour, width: 2.2, dash: "dash" },
      opacity: Math.max(0.25, 1 + (path.level_db - strongest) / 40),
    }));
    return [...rays, {
      type: "circle", layer: "above", xsizemode: "pixel", ysizemode: "pixel",
      xanchor: place[0], yanchor: place[1], x0: -11, x1: 11, y0: -11, y1: 11,
      line: { color: colour, width: 3 }, fillcolor: "rgba(0,0,0,0)",
    }];
  };

  const mirrorNames = (chain) => (chain.length
    ? chain.map((i) => page.mirrors[i].name).join(" → ") : "direct");
  const fill = () => {
    const table = document.getElementById("moved-paths");
    const told = document.getElementById("moved-place");
    table.hidden = !paths.length;
    if (!place) return;
    told.textContent = `A user at ${placeText(place)}: ` + (paths.length
      ? `${paths.length} path${paths.length === 1 ? "" : "s"}`
      : "no path over the mirrors found, nor a direct one");
    table.replaceChildren(tableRow("th", ["over", "angle of arrival",
      ...(map.dimensions === 3 ? ["elevation"] : []), "delay", "length", "level"]));
    for (const path of paths) {
      const degrees = (angle) => `${(angle * 180 / Math.PI).toFixed(3)}°`;
      const spread = path.deviation_db ? ` ± ${path.deviation_db.toFixed(1)}` : "";
      table.append(tableRow("td", [mirrorNames(path.mirrors), degrees(path.aoa),
        ...(map.dimensions === 3 ? [degrees(path.elevation)] : []),
        `${(1e9 * path.delay).toFixed(4)} ns`, metres(path.path_length),
        `${path.level_db.toFixed(1)}${spread} dB`]));
    }
  };

  const update = () => {
    waiting = false;
    paths = predictedPaths(place, map);
    fill();
    Plotly.relayout(plot, { shapes: layout().shapes });
    plot.dispatchEvent(new CustomEvent("moveduser", { detail: { place, paths } }));
  };
  const put = (point) => {
    place = [point[0], point[1], map.dimensions === 3 ? Number(height.value) : map.frame.origin[2]];
    if (!waiting) {
      waiting = true;
      requestAnimationFrame(update);
    }
  };

  const begin = () => {
    if (place && height) height.value = place[2];
    if (height) {
      height.addEventListener("input", () => {
        document.getElementById("moved-height-text").textContent = metres(Number(height.value), 2);
        if (place) put(place);
      });
      document.getElementById("moved-height-text").textContent = metres(Number(height.value), 2);
    }
    const stop = (event) => {
      event.preventDefault();
      event.stopPropagation();
    };
    // Before Plotly, which would pan the plan.
    plot.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.target.closest(".modebar") || !inPlan(event)) return;
      pressed = { x: event.clientX, y: event.clientY };
      grasped = isOn() && near(event);
      if (grasped) {
        stop(event);
        plot.setPointerCapture(event.pointerId);
      }
    }, true);
    for (const kind of ["mousedown", "touchstart"]) {
      plot.addEventListener(kind, (event) => { if (grasped) stop(event); }, { capture: true, passive: false });
    }
    window.addEventListener("pointermove", (event) => {
      const point = grasped ? inPlan(event) : null;
      if (point) put(point);
      else if (!grasped && place) plot.classList.toggle("graspable", isOn() && near(event));
    });
    window.addEventListener("pointerup", (event) => {
      const still = pressed && Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) < STILL;
      const point = inPlan(event);
      if (still && !grasped && point && isOn()) put(point);
      grasped = false;
      pressed = null;
    });
    window.addEventListener("pointercancel", () => { grasped = false; pressed = null; });
    if (place) update();
  };
  return { shapes, begin };
}
