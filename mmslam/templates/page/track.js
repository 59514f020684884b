// Users that move: the plan of the room, their tracks, and a slider over the times.
"use strict";

const TRACK_COLOURS = [["#d1495b", "#ff9aa8"], ["#5c4d7d", "#c9b8ff"], ["#b36b00", "#ffd27a"],
  ["#30638e", "#8fc1ff"], ["#0b7a75", "#8ff0e4"]];

function ellipseLine(place, [a, b, turn]) {
  return Array.from({ length: 61 }, (_, i) => {
    const [u, v] = [a * Math.cos(i * Math.PI / 30), b * Math.sin(i * Math.PI / 30)];
    return [place[0] + u * Math.cos(turn) - v * Math.sin(turn), place[1] + u * Math.sin(turn) + v * Math.cos(turn)];
  });
}

async function drawTracks() {
  const plot = document.getElementById("track-plot");
  const slider = document.getElementById("track-time");
  const layers = [["mirrors", "mirrors", "mirror"], ["ways", "tracks", "user"], ["located", "located", "path"],
    ["ellipses", "95 % ellipses at all times", "user"], ["truth", "truth", "truth"], ["now", "at this time", "predicted"]]
    .map(([id, label, role]) => ({ id, label, role, on: id !== "ellipses" }));
  const isOn = (id) => !layers.some((layer) => layer.id === id && !layer.on);
  slider.max = page.times.length - 1;

  const traces = () => {
    const theme = darkTheme.matches ? 1 : 0;
    const made = [];
    const add = (layer, trace) => made.push({ layer, trace: { type: "scatter", visible: isOn(layer), ...trace } });
    const points = (layer, list, colour, symbol, size, text) => add(layer, { mode: "markers",
      x: list.map((p) => p[0]), y: list.map((p) => p[1]), hovertext: text, hoverinfo: "text",
      marker: { color: colour, symbol, size, line: { width: 2, color: colour } } });
    add("mirrors", { mode: "lines", ...brokenLines(page.mirrors.map((one) => one.line)), hoverinfo: "skip",
      line: { color: ROLES.mirror[theme], width: 3, dash: "dash" } });
    points("mirrors", page.mirrors.map((one) => middle(one.line)), ROLES.mirror[theme], "circle", 5, page.mirrors.map(mirrorText));
    points("array", page.array, ROLES.array[theme], "square", 5, "array");
    page.tracks.forEach((track, k) => {
      const colour = TRACK_COLOURS[k % TRACK_COLOURS.length][theme];
      const held = track.moments.map((moment, i) => ({ ...moment, time: page.times[i] }));
      const told = (p, what, time) => `${plainText(track.name)} ${what} at ${time.toFixed(3)} s<br>${placeText(p)}`;
      const true_ = held.filter((one) => one.truth);
      points("truth", true_.map((one) => one.truth), ROLES.truth[theme], "circle-open", 11, true_.map((one) => told(one.truth, "truly", one.time)));
      const located = held.filter((one) => one.located);
      points("located", located.map((one) => one.located), ROLES.path[theme], "x-thin", 8, located.map((one) => told(one.located, "located", one.time)));
      const way = held.filter((one) => one.point);
      add("ways", { mode: "lines+markers", x: way.map((one) => one.point.position[0]), y: way.map((one) => one.point.position[1]),
        hovertext: way.map((one) => told(one.point.position, "tracked", one.time)), hoverinfo: "text",
        line: { color: colour, width: 2 }, marker: { color: colour, size: 5 } });
      add("ellipses", { mode: "lines", hoverinfo: "skip", line: { color: colour, width: 1 },
        ...brokenLines(way.map((one) => ellipseLine(one.point.position, one.point.ellipse).map((p) => [...p, 0]))) });
    });
    return made;
  };

  const now = () => { // rings and ellipses as shapes: moving them redraws nothing else
    const moment = Number(slider.value);
    const theme = darkTheme.matches ? 1 : 0;
    const line = { color: ROLES.predicted[theme], width: 3 };
    const shapes = [];
    for (const track of page.tracks) {
      const { point } = track.moments[moment];
      if (!point || !isOn("now")) continue;
      const [x, y] = point.position;
      const outline = ellipseLine(point.position, point.ellipse);
      shapes.push({ type: "circle", xsizemode: "pixel", ysizemode: "pixel", xanchor: x, yanchor: y,
        x0: -10, x1: 10, y0: -10, y1: 10, line: { ...line, dash: point.bridged ? "dot" : "solid" } });
      shapes.push({ type: "path", path: outline.map((p, i) => `${i ? "L" : "M"}${p[0]},${p[1]}`).join("") + "Z", line: { ...line, width: 1.5 } });
    }
    return shapes;
  };
  const tell = () => {
    const moment = Number(slider.value);
    document.getElementById("track-now").textContent = `${page.times[moment].toFixed(3)} s`;
    const table = document.getElementById("track-table");
    const known = page.tracks.some((track) => track.moments.some((one) => one.truth));
    table.replaceChildren(tableRow("th", ["user", "position", "±", "speed", "basis", ...(known ? ["off"] : [])]));
    for (const track of page.tracks) {
      const { point, status } = track.moments[moment];
      const basis = point && point.bridged ? `bridged (${status})` : status;
      const error = point && point.error_m !== null ? millimetres(point.error_m) : "—";
      table.append(tableRow("td", point
        ? [track.name, placeText(point.position), millimetres(point.deviation_m), `${point.speed_m_s.toFixed(2)} m/s`,
          point.alternative ? `${basis}, alternative ${point.alternative} taken` : basis, ...(known ? [error] : [])]
        : [track.name, "before the track begins", "", "", status, ...(known ? ["—"] : [])]));
    }
  };
  const layout = () => ({ ...baseLayout(), ...planAxes(page.view.x, page.view.y), hovermode: "closest", dragmode: "pan", shapes: now() });
  const redraw = () => Plotly.react(plot, traces().map((one) => one.trace), layout(), PLOT_OPTIONS);
  const move = () => { tell(); Plotly.relayout(plot, { shapes: now() }); };

  layerSwitches(document.getElementById("track-layers"), layers, redraw);
  slider.addEventListener("input", move);
  let playing = null;
  const play = button(document.getElementById("track-play"), "play", () => {
    if (playing !== null) {
      clearInterval(playing);
      playing = null;
    } else {
      if (Number(slider.value) >= page.times.length - 1) slider.value = 0;
      playing = setInterval(() => {
        if (Number(slider.value) >= page.times.length - 1) { play.click(); return; }
        slider.value = Number(slider.value) + 1;
        move();
      }, Math.max(40, 8000 / page.times.length));
    }
    play.textContent = playing === null ? "play" : "pause";
  });
  const zoom = document.getElementById("track-zoom");
  const range = (x, y) => Plotly.relayout(plot, { "xaxis.range": x, "yaxis.range": y });
  button(zoom, "whole plan", () => range([...page.view.x], [...page.view.y]));
  const places = page.tracks.flatMap((track) => track.moments.filter((one) => one.point).map((one) => one.point.position));
  if (places.length) {
    button(zoom, "zoom to the tracks", () => {
      const limits = [0, 1].map((i) => {
        const column = places.map((p) => p[i]);
        const [low, high] = [Math.min(...column), Math.max(...column)];
        const margin = 0.1 * (high - low) + 0.005;
        return [low - margin, high + margin];
      });
      range(...limits);
    });
  }
  tell();
  await redraw();
  for (const query of [darkTheme, narrow]) query.addEventListener("change", redraw);
  plot.dataset.drawn = "yes";
}

drawTracks();
