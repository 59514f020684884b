// What all pages share: their data, the theme, layers to switch, images of coded levels.
"use strict";

const page = JSON.parse(document.getElementById("page-data").textContent);
const darkTheme = window.matchMedia("(prefers-color-scheme: dark)");
const narrow = window.matchMedia("(max-width: 640px)");

// matplotlib's "magma", which Plotly does not bring.
const MAGMA = ["#000004", "#1c1044", "#4f127b", "#812581", "#b5367a", "#e55064", "#fb8761",
  "#fec287", "#fcfdbf"].map((colour, i) => [i / 8, colour]);

const ROLES = { // on a light ground, on a dark one or an image
  array: ["#30638e", "#8fc1ff"],
  mirror: ["#0b7a75", "#8ff0e4"],
  target: ["#8a4fa0", "#e3b5ff"],
  path: ["#b36b00", "#ffd27a"],
  user: ["#d1495b", "#ff9aa8"],
  truth: ["#7a858e", "#c9d1d6"],
  predicted: ["#0058c9", "#6fd3ff"],
};

// Plotly reads tags and entities in text: what data give is shown literally.
function plainText(text) {
  return String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
}

// Numbers for people; what is not known is a dash, and there is no minus zero.
const fixed = (value, digits) => (value === null ? "—" : value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1"));
const metres = (value, digits = 4) => `${fixed(value, digits)} m`;
const millimetres = (value) => (value === null ? "—" : `${(1e3 * value).toPrecision(3)} mm`);
const placeText = (p, n = page.dimensions) =>
  `(${p.slice(0, n).map((x) => fixed(x, 4)).join(", ")}) m`;
const cssColour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// Bytes, the first axis fastest; see mmslam/results/page/level_codes.py.
async function decodedLevels(coded) {
  const packed = Uint8Array.from(atob(coded.codes), (sign) => sign.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const codes = new Uint8Array(await new Response(stream).arrayBuffer());
  const decibels = Float32Array.from({ length: 256 }, (_, c) =>
    c === 0 ? NaN : coded.floor_db * (255 - c) / 254);
  const axis = (name) => {
    const { first, step, count } = coded.axes[name];
    return Float64Array.from({ length: count }, (_, i) => first + i * step);
  };
  const axes = Object.fromEntries(Object.keys(coded.axes).map((name) => [name, axis(name)]));
  return { codes, decibels, axes, floor: coded.floor_db, peak: coded.peak_db };
}

function levelBar() {
  const bar = { title: { text: "dB below the peak", side: "right" }, thickness: 12, outlinewidth: 0 };
  return narrow.matches
    ? { ...bar, title: { ...bar.title, side: "top" }, orientation: "h", y: -0.28, yanchor: "top" }
    : bar;
}

function baseLayout() {
  const ink = cssColour("--ink");
  return {
    autosize: true,
    margin: narrow.matches ? { l: 48, r: 8, t: 8, b: 44 } : { l: 60, r: 10, t: 10, b: 50 },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: cssColour("--paper"),
    font: { color: ink, family: "system-ui, -apple-system, Segoe UI, Roboto, sans-serif", size: 12 },
    hoverlabel: { font: { size: 12 }, align: "left" },
    showlegend: false,
    uirevision: "kept", // zoom stays when layers change
  };
}

function planAxes(x, y, names = ["x", "y"], black = false) {
  const grid = black ? "#26262f" : cssColour("--line");
  const line = { gridcolor: grid, zerolinecolor: grid, constrain: "domain" };
  return {
    xaxis: { ...line, title: { text: `${names[0]} [m]` }, range: x },
    yaxis: { ...line, title: { text: `${names[1]} [m]` }, range: y, scaleanchor: "x" },
  };
}

const PLOT_OPTIONS = {
  responsive: true, displaylogo: false, scrollZoom: true,
  showSendToCloud: false, showLink: false, plotlyServerURL: "", // nothing leaves this machine
  modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
};

// Check boxes for layers: [{ id, label, role, on }]. `changed` is called after each switch.
function layerSwitches(box, layers, changed) {
  for (const layer of layers) {
    const label = document.createElement("label");
    const input = document.createElement("input");
    input.type = "checkbox";
    input.checked = layer.on;
    input.dataset.layer = layer.id;
    input.addEventListener("change", () => {
      layer.on = input.checked;
      if (layer.on && layer.instead) { // one image at a time
        for (const other of layers) {
          if (other !== layer && other.instead === layer.instead && other.on) {
            other.on = false;
            box.querySelector(`[data-layer="${other.id}"]`).checked = false;
          }
        }
      }
      changed();
    });
    const swatch = document.createElement("span");
    swatch.className = `swatch ${layer.role || "image"}`;
    label.append(input, swatch, document.createTextNode(layer.label));
    box.append(label);
  }
}

function button(box, text, pressed) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  made.addEventListener("click", pressed);
  box.append(made);
  return made;
}

function tableRow(kind, cells) {
  const row = document.createElement("tr");
  for (const cell of cells) {
    const made = document.createElement(kind);
    made.textContent = cell;
    row.append(made);
  }
  return row;
}
