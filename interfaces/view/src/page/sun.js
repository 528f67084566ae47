// A day of sun: the time of its shadows, and points that were clicked.
let day = null;
const points = [];
const LIT = "#e8a917", SHADED = "#8b95a1";
const clock = (hour) => {
  const minutes = Math.round(60 * hour);
  return `${String(Math.floor(minutes / 60)).padStart(2, "0")}:${String(minutes % 60).padStart(2, "0")}`;
};
const showsSun = () => status.mode === "hours" || status.mode === "shadows";

async function fetchDay() {
  if (day || fetchDay.asked) return;
  fetchDay.asked = true;
  const answer = await fetch("sun");
  if (!answer.ok) return;
  day = await answer.json();
  put("day", day.caption);
  const up = day.suns.filter((sun) => sun.elevation > 0);
  if (up.length) {
    // No shadows are to be seen at night.
    $("hour").min = Math.max(0, Math.floor(up[0].hour));
    $("hour").max = Math.min(24, Math.ceil(up[up.length - 1].hour));
  }
  showHour(status.hour);
}
function sunAt(hour) {
  return day.suns.reduce((best, sun) => (Math.abs(sun.hour - hour) < Math.abs(best.hour - hour) ? sun : best));
}
function showHour(hour) {
  if (!day) return;
  if (document.activeElement !== $("hour") || !sending) $("hour").value = hour;
  put("clock", clock(hour));
  const sun = sunAt(hour);
  put("sunplace", sun.elevation > 0 ? `Sun ${sun.elevation.toFixed(0)}° high, azimuth ${sun.azimuth.toFixed(0)}°` : "Sun below the horizon");
  $("hour").setAttribute("aria-valuetext", clock(hour));
  drawPoint();
}

/** Asks for the day of the point at a place of the picture, in fractions of the whole. */
async function pick([x, y]) {
  const answer = await fetch(`point?x=${x}&y=${y}`);
  const found = answer.ok ? await answer.json() : null;
  if (!found) return;
  points.push(found);
  document.body.dataset.points = points.length;
  $("csv").setAttribute("aria-disabled", false);
  $("forget").disabled = false;
  saveable();
  drawPoint();
  mark();
}
/** Hours of the last point as a diagram: height of the sun over the day, bright where the point sees it. */
function drawPoint() {
  const point = points[points.length - 1];
  $("point").hidden = !point;
  $("hint").hidden = !!point;
  if (!point || !day) return;
  const [width, height, base] = [288, 92, 74];
  const x = (hour) => (hour / 24) * width;
  const most = Math.max(30, ...day.suns.map((sun) => sun.elevation));
  const y = (sun) => base - (Math.max(0, sun.elevation) / most) * (base - 4);
  const bar = (sun, fill) => `<rect x="${(x(sun.hour - day.step / 2) - 0.15).toFixed(2)}" y="${y(sun).toFixed(1)}" width="${(x(day.step) + 0.3).toFixed(2)}" height="${(base - y(sun)).toFixed(1)}" fill="${fill}"/>`;
  const bars = day.suns.map((sun, i) => (sun.elevation > 0 ? bar(sun, point.seen[i] ? LIT : SHADED) : "")).join("");
  const ticks = [0, 6, 12, 18, 24].map((hour) => `<text x="${x(hour)}" y="${height - 3}" text-anchor="${hour === 0 ? "start" : hour === 24 ? "end" : "middle"}">${hour}</text>`).join("");
  const now = status.mode === "shadows" ? `<line x1="${x(status.hour)}" x2="${x(status.hour)}" y1="0" y2="${base}" stroke="currentColor"/>` : "";
  $("diagram").innerHTML = `<line x1="0" x2="${width}" y1="${base}" y2="${base}" stroke="currentColor" stroke-width=".5"/>${bars}${now}<g font-size="11" fill="currentColor">${ticks}</g>`;
  $("diagram").setAttribute("aria-label", `Hours of sun of point ${points.length}`);
  put("pointhours", `Point ${points.length}: ${point.hours.toFixed(1)} h of direct sun`);
  put("pointplace", point.point.map((v) => v.toFixed(2)).join(", "));
}
/** The points as a table: a column for each step of the day. */
function table() {
  const steps = day.suns.map((sun) => clock(sun.hour - day.step / 2));
  const head = ["point", "x", "y", "z", "nx", "ny", "nz", "hours", ...steps];
  const row = (p, i) => [i + 1, ...p.point.map((v) => Number(v.toFixed(6))), ...p.normal, Number(p.hours.toFixed(4)), ...p.seen.map(Number)];
  return [head, ...points.map(row)].map((cells) => cells.join(",")).join("\n") + "\n";
}
function saveable() {
  URL.revokeObjectURL($("csv").href);
  $("csv").href = URL.createObjectURL(new Blob([table()], { type: "text/csv" }));
  $("csv").download = `${(status.title || "sun").replace(/[^A-Za-z0-9]+/g, "-")}-points.csv`;
}
/** Puts numbers on the points, where the camera sees them. */
function mark() {
  const frame = picture.frame, box = $("marks");
  box.hidden = !showsSun() || !points.length;
  if (box.hidden || !frame || !look) return;
  const { forward, right, up } = axes(look, status.mirrored);
  const tan = Math.tan((look.fov * Math.PI) / 360), short = Math.min(frame.width, frame.height);
  const stage = $("stage").getBoundingClientRect(), shown = canvas.getBoundingClientRect();
  const signs = points.map((point, i) => {
    const way = sub(sub(point.point, status.origin), look.eye), far = dot(way, forward);
    if (far <= 0) return "";
    const across = frame.width / 2 + (dot(way, right) / far / tan) * (short / 2);
    const down = frame.height / 2 - (dot(way, up) / far / tan) * (short / 2);
    const [u, v] = [(across - frame.left) / frame.columns, (down - frame.above) / frame.rows];
    if (u < 0 || u > 1 || v < 0 || v > 1) return "";
    const left = shown.left - stage.left + u * shown.width, top = shown.top - stage.top + v * shown.height;
    return `<span style="left:${left.toFixed(1)}px;top:${top.toFixed(1)}px">${i + 1}</span>`;
  });
  box.innerHTML = signs.join("");
}
/** Shows what belongs to the sun, and hides what does not. */
function showSun(next) {
  const has = next.has_sun;
  document.body.classList.toggle("sunny", has);
  $("sunbox").hidden = !has;
  if (!has) return;
  fetchDay();
  const hours = next.mode === "hours";
  $("legend").hidden = !hours;
  if (hours && day) $("high").textContent = `${day.longest.toFixed(0)} h`;
  if (!sending) showHour(next.hour);
  document.body.dataset.hour = next.hour;
  document.body.dataset.mode = next.mode;
  mark();
}
$("hour").addEventListener("input", () => {
  const hour = Number($("hour").value);
  showHour(hour);
  wish({ hour, mode: undefined });
});
$("forget").addEventListener("click", () => {
  points.length = 0;
  document.body.dataset.points = 0;
  $("csv").setAttribute("aria-disabled", true);
  $("forget").disabled = true;
  drawPoint();
  mark();
});
