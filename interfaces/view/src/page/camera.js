"use strict";
// Cameras as eye, target and up vector. The space is left-handed, as pbrt has it: right = up x forward.
const add = (a, b) => a.map((x, i) => x + b[i]);
const sub = (a, b) => a.map((x, i) => x - b[i]);
const scaled = (a, k) => a.map((x) => x * k);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => Math.sqrt(dot(a, a));
const unit = (a) => scaled(a, 1 / (norm(a) || 1));
/** Turns a vector about an axis of length 1, by Rodrigues' formula. */
function turned(v, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return add(add(scaled(v, c), scaled(cross(axis, v), s)), scaled(axis, dot(axis, v) * (1 - c)));
}
/** Directions of a camera: forward, and right and up as they are on the screen. */
function axes(look, mirrored) {
  const forward = unit(sub(look.at, look.eye));
  const right = unit(cross(unit(look.up), forward));
  return { forward, up: cross(forward, right), right: mirrored ? scaled(right, -1) : right };
}
/** Eye or target turned about the other: `about` stays. Never over the poles. */
function swung(about, end, up, right, yaw, pitch) {
  const pole = unit(up);
  let arm = turned(sub(end, about), pole, yaw);
  right = turned(right, pole, yaw);
  const angle = Math.acos(Math.max(-1, Math.min(1, dot(unit(arm), pole))));
  const next = turned(arm, right, pitch);
  const after = Math.acos(Math.max(-1, Math.min(1, dot(unit(next), pole))));
  const limit = 0.02;
  if ((after > limit && after < Math.PI - limit && Math.abs(pitch) < 1.5) || Math.abs(after - Math.PI / 2) < Math.abs(angle - Math.PI / 2)) arm = next;
  return add(about, arm);
}
/** Turns around the target: the scene follows the mouse. Angles in radians. */
function orbit(look, mirrored, dx, dy) {
  const right = unit(cross(unit(look.up), unit(sub(look.at, look.eye))));
  return { ...look, eye: swung(look.at, look.eye, look.up, right, mirrored ? -dx : dx, dy) };
}
/** Turns the head. Angles in radians, to the right and up. */
function head(look, mirrored, dx, dy) {
  const right = unit(cross(unit(look.up), unit(sub(look.at, look.eye))));
  return { ...look, at: swung(look.eye, look.at, look.up, right, mirrored ? -dx : dx, -dy) };
}
/** Walks to the right, up and forward, in units of the scene. */
function walk(look, mirrored, x, y, z) {
  const { right, up, forward } = axes(look, mirrored);
  const way = add(add(scaled(right, x), scaled(up, y)), scaled(forward, z));
  return { ...look, eye: add(look.eye, way), at: add(look.at, way) };
}
/** Distance to the target times a factor. */
function nearer(look, factor) {
  return { ...look, eye: add(look.at, scaled(sub(look.eye, look.at), factor)) };
}
/** Length at the target that a pixel of the picture shows, for a shorter side of so many pixels. */
function pixelLength(look, side) {
  return (2 * norm(sub(look.at, look.eye)) * Math.tan((look.fov * Math.PI) / 360)) / side;
}
