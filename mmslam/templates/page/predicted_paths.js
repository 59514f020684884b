// The paths from a user to the array by the image method over the mirrors that were found, as
// estimator/prediction/channel_2d.py and estimator/geometry/path_tracing.py have them: extents are
// finite, and what stands between hides. Lengths in metres, angles in radians, in the world's frame.
"use strict";

const SPEED_OF_LIGHT = 299792458; // [m/s]
const GRAZING = 1e-12; // sine between a ray and a mirror below which they are parallel

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const along = (a, t, b) => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => Math.sqrt(dot(a, a));
const unit = (a) => a.map((x) => x / norm(a));

// A mirror of a line (two ends, upright without limit) or of a convex polygon (corners in order).
function mirrorOf(corners) {
  if (corners.length === 2) {
    const way = minus(corners[1], corners[0]);
    return { corners, point: corners[0], normal: unit([way[1], -way[0], 0]) };
  }
  // Newell's normal: of all corners, which are in one plane but for rounding.
  let normal = [0, 0, 0];
  corners.forEach((corner, i) => {
    normal = along(normal, 1, cross(corner, corners[(i + 1) % corners.length]));
  });
  const sum = corners.reduce((a, b) => along(a, 1, b), [0, 0, 0]);
  return { corners, point: sum.map((x) => x / corners.length), normal: unit(normal) };
}

// How far a point of the mirror's plane is inside its rim; negative outside. [m]
function depth(point, mirror) {
  const corners = mirror.corners;
  if (corners.length === 2) {
    const way = minus(corners[1], corners[0]);
    const length = norm(way);
    const from = dot(minus(point, corners[0]), way) / length;
    return Math.min(from, length - from);
  }
  return Math.min(...corners.map((corner, i) => {
    const edge = unit(minus(corners[(i + 1) % corners.length], corner));
    return dot(cross(mirror.normal, edge), minus(point, corner));
  }));
}

// Where the leg from a to b meets the mirror: its distance from a and from the rim, or null.
function meeting(a, b, mirror) {
  const way = minus(b, a);
  const far = norm(way);
  if (far === 0) return null;
  const heading = way.map((x) => x / far);
  const slope = dot(heading, mirror.normal);
  if (Math.abs(slope) < GRAZING) return null;
  const distance = dot(minus(mirror.point, a), mirror.normal) / slope;
  if (!(distance > 0) || !(distance < far)) return null;
  const point = along(a, distance, heading);
  const margin = depth(point, mirror);
  return margin >= 0 ? { point, margin } : null;
}

const imageIn = (point, mirror) =>
  along(point, -2 * dot(minus(point, mirror.point), mirror.normal), mirror.normal);

// All chains of up to `most` of n mirrors, none twice running, fewer mirrors first.
function chainsOf(n, most) {
  const chains = [[]];
  let last = [[]];
  for (let bounce = 0; bounce < most; bounce += 1) {
    const longer = [];
    for (const chain of last) {
      for (let i = 0; i < n; i += 1) {
        if (chain[chain.length - 1] !== i) longer.push([...chain, i]);
      }
    }
    chains.push(...longer);
    last = longer;
  }
  return chains;
}

// map: { frame: { origin, axes }, frequency_hz, max_bounces, mirrors: [corners], screens:
// [corners], level_db: [of each mirror], deviation_db: [of each] }. Strongest path first.
function predictedPaths(user, map) {
  const { origin, axes } = map.frame;
  const local = (point) => axes.map((axis) => dot(axis, minus(point, origin)));
  const world = (point) => axes.reduce((sum, axis, i) => along(sum, point[i], axis), origin);
  const flat = map.mirrors.every((corners) => corners.length === 2) && map.dimensions === 2;
  const inFrame = (corners) => mirrorOf(corners.map(local));
  const mirrors = map.mirrors.map(inFrame);
  const screens = [...mirrors, ...map.screens.map(inFrame)];
  const place = local(user);
  if (flat) place[2] = 0;
  const array = [0, 0, 0];
  const paths = [];
  for (const chain of chainsOf(mirrors.length, map.max_bounces)) {
    const images = [place]; // of the user, over more and more of the chain from its far end
    for (let i = chain.length - 1; i >= 0; i -= 1) images.unshift(imageIn(images[0], mirrors[chain[i]]));
    const image = images[0];
    if (!(image[1] > 0)) continue; // behind the array
    let vertices = [array];
    let margin = Infinity;
    for (let i = 0; i < chain.length && vertices; i += 1) {
      const met = meeting(vertices[i], images[i], mirrors[chain[i]]);
      margin = met ? Math.min(margin, met.margin) : margin;
      vertices = met ? [...vertices, met.point] : null;
    }
    if (!vertices) continue;
    vertices.push(place);
    const hidden = screens.some((screen, i) => vertices.slice(1).some((end, leg) =>
      chain[leg - 1] !== i && chain[leg] !== i && meeting(vertices[leg], end, screen)));
    if (hidden) continue;
    const length = norm(image);
    const times = mirrors.map((_, i) => chain.filter((met) => met === i).length);
    const free = 20 * Math.log10(SPEED_OF_LIGHT / map.frequency_hz / (4 * Math.PI * length));
    paths.push({
      mirrors: chain,
      vertices: vertices.map(world),
      aoa: flat ? Math.atan2(image[1], image[0]) : Math.acos(image[0] / length),
      elevation: flat ? null : Math.asin(image[2] / length),
      path_length: length,
      delay: length / SPEED_OF_LIGHT,
      level_db: free + times.reduce((sum, n, i) => sum + n * map.level_db[i], 0),
      deviation_db: Math.sqrt(times.reduce((sum, n, i) => sum + (n * map.deviation_db[i]) ** 2, 0)),
      margin,
    });
  }
  return paths.sort((a, b) => b.level_db - a.level_db);
}
