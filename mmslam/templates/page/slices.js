// Planes through a volume, one at a time, along any axis.
"use strict";

const CROSS = { x: ["y", "z"], y: ["x", "z"], z: ["x", "y"] };
const INDEX = { x: 0, y: 1, z: 2 };

// Where the plane `axis` = value cuts a mirror's outline: two points, or none.
function cutOf(corners, axis, value) {
  const at = INDEX[axis];
  const cuts = [];
  corners.forEach((a, i) => {
    const b = corners[(i + 1) % corners.length];
    const [from, to] = [a[at] - value, b[at] - value];
    if ((from < 0) !== (to < 0)) {
      const share = from / (from - to);
      cuts.push(a.map((x, k) => x + share * (b[k] - x)));
    }
  });
  return cuts.length >= 2 ? cuts.slice(0, 2) : null;
}

async function drawSlices() {
  const plot = document.getElementById("slice-plot");
  const volumes = {};
  for (const [name, coded] of Object.entries(page.volumes)) volumes[name] = await decodedLevels(coded);
  const which = document.getElementById("slice-volume");
  const along = document.getElementById("slice-axis");
  const at = document.getElementById("slice-at");
  const deepest = document.getElementById("plan-floor"); // of all images
  if (!Object.keys(volumes).length) {
    document.getElementById("slices").hidden = true;
    return;
  }
  for (const name of Object.keys(volumes)) which.append(new Option(`${name} image`, name));
  const { axes } = Object.values(volumes)[0]; // first across the thinnest side: the most is seen
  along.value = ["x", "y", "z"].reduce((a, b) => (axes[b].length < axes[a].length ? b : a));

  const slice = () => {
    const volume = volumes[which.value];
    const axis = along.value;
    const [right, up] = CROSS[axis];
    const { x, y } = volume.axes;
    const stride = { x: 1, y: x.length, z: x.length * y.length };
    const [across, upward] = [volume.axes[right], volume.axes[up]];
    const base = Number(at.value) * stride[axis];
    const z = Array.from(upward, (_, row) => Array.from(across, (_, column) =>
      volume.decibels[volume.codes[base + row * stride[up] + column * stride[right]]]));
    return { volume, axis, right, up, across, upward, z, value: volume.axes[axis][Number(at.value)] };
  };
  const draw = () => {
    const { volume, axis, right, up, across, upward, z, value } = slice();
    document.getElementById("slice-text").textContent = `${axis} = ${metres(value)}`;
    const data = [{
      type: "heatmap", x: across, y: upward, z, zmin: Number(deepest.value), zmax: 0, zsmooth: "fast",
      colorscale: MAGMA, colorbar: levelBar(), hoverongaps: false,
      hovertemplate: `${right} %{x:.4f} m<br>${up} %{y:.4f} m<br>%{z:.1f} dB below the peak<extra></extra>`,
    }];
    for (const mirror of page.mirrors.filter((one) => one.corners)) {
      const cut = cutOf(mirror.corners, axis, value);
      if (cut) {
        data.push({ type: "scatter", mode: "lines", x: cut.map((p) => p[INDEX[right]]),
          y: cut.map((p) => p[INDEX[up]]), text: mirrorText(mirror), hoverinfo: "text",
          line: { color: ROLES.mirror[1], width: 2, dash: "dash" } });
      }
    }
    const layout = { ...baseLayout(), plot_bgcolor: "#000004", dragmode: "pan", hovermode: "closest",
      ...planAxes([across[0], across[across.length - 1]], [upward[0], upward[upward.length - 1]], [right, up], true),
      uirevision: axis + which.value };
    return Plotly.react(plot, data, layout, PLOT_OPTIONS);
  };
  const brightest = () => { // of this volume, along this axis
    const volume = volumes[which.value];
    const best = volume.codes.indexOf(255);
    const { x, y, z } = volume.axes;
    const place = { x: best % x.length, y: Math.floor(best / x.length) % y.length, z: Math.floor(best / x.length / y.length) };
    at.max = { x, y, z }[along.value].length - 1;
    at.value = Math.max(place[along.value], 0);
    return draw();
  };
  for (const choice of [which, along]) choice.addEventListener("change", brightest);
  for (const slider of [at, deepest]) slider.addEventListener("input", draw);
  await brightest();
  for (const query of [darkTheme, narrow]) query.addEventListener("change", draw);
  plot.dataset.drawn = "yes";
}
