// The page: reads the stream, shows it, and sends wishes.
const $ = (id) => document.getElementById(id);
const picture = new Picture($("picture"));
let status = {}, look = null, stops = 0, range = 1, rangeBefore = 0, ended = false;
let sunShown = false;
let drawn = 0, since = performance.now(), cropping = false;

// Wishes. One is under way at a time, and later ones are put together. A request costs the browser as much as a part of
// a picture, so there are no more of them than pictures.
const BETWEEN = 30;
let waiting = null, sending = false;
async function wish(change) {
  waiting = { ...(waiting || {}), ...change };
  if (sending) return;
  sending = true;
  while (waiting) {
    const body = JSON.stringify(waiting), begun = performance.now();
    waiting = null;
    try {
      await fetch("wish", { method: "POST", body });
    } catch {
      break;
    }
    const rest = begun + BETWEEN - performance.now();
    if (rest > 0) await new Promise((later) => setTimeout(later, rest));
  }
  sending = false;
}
function move(next) {
  look = next;
  showPose();
  mark();
  wish({ look });
}

// The stream.
async function read() {
  const answer = await fetch("stream");
  if (!answer.ok) throw new Error(answer.statusText);
  gone(null);
  const reader = answer.body.getReader();
  let kept = new Uint8Array(0);
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    if (kept.length) {
      const joined = new Uint8Array(kept.length + value.length);
      joined.set(kept);
      joined.set(value, kept.length);
      kept = joined;
    } else {
      kept = value;
    }
    let at = 0;
    const view = new DataView(kept.buffer, kept.byteOffset, kept.byteLength);
    while (at + 4 <= kept.length) {
      const end = at + 4 + view.getUint32(at, true);
      if (end > kept.length) break;
      message(view, at + 4, end);
      at = end;
    }
    kept = kept.slice(at);
  }
}
function message(view, at, end) {
  const kind = String.fromCharCode(view.getUint8(at));
  at += 1;
  if (kind === "S") {
    show(JSON.parse(new TextDecoder().decode(new Uint8Array(view.buffer, view.byteOffset + at, end - at))));
  } else if (kind === "F") {
    const [number, scale, width, height, x0, y0, x1, y1, map] = Array.from({ length: 9 }, (_, i) => view.getInt32(at + 4 * i, true));
    const old = picture.frame && [picture.frame.columns, picture.frame.rows];
    picture.begin({ number, scale, width, height, x0, y0, x1, y1, map: map === 1 });
    if (!old || old[0] !== picture.frame.columns || old[1] !== picture.frame.rows) fit();
    document.body.dataset.frame = number;
    document.body.dataset.scale = scale;
    // Blocks of a coarse picture hide what one aims at.
    const shown = canvas.clientWidth / Math.max(1, picture.frame.columns);
    canvas.style.filter = scale > 2 && map !== 1 ? `blur(${(0.4 * scale * shown).toFixed(1)}px)` : "";
  } else if (kind === "T") {
    picture.tiles(view, at, end);
    document.body.dataset.tiles = (Number(document.body.dataset.tiles) || 0) + 1;
  }
}
async function follow() {
  for (let tries = 0; ; tries++) {
    try {
      await read();
      tries = 0;
    } catch {
      // Said below.
    }
    if (status.phase === "failed") gone("There is no picture: " + status.text);
    else gone("The program has ended, or cannot be reached. What is shown stays until this page is closed.");
    if (ended || tries > 30) return;
    await new Promise((later) => setTimeout(later, 2000));
  }
}
function gone(text) {
  $("gone").hidden = !text;
  $("gone").textContent = text || "";
  document.body.dataset.gone = text ? "yes" : "no";
  for (const id of ["home", "crop", "stop", "quit"]) $(id).disabled = !!text;
  for (const id of ["png", "exr"]) $(id).setAttribute("aria-disabled", !!text);
  if (text) $("text").textContent = "not connected";
}

// Words and figures.
function time(seconds) {
  if (seconds === null || seconds === undefined) return "–";
  if (seconds < 10) return seconds.toFixed(1) + " s";
  const whole = Math.round(seconds);
  if (whole < 60) return whole + " s";
  const [minutes, hours] = [Math.floor(whole / 60), Math.floor(whole / 3600)];
  return hours ? `${hours} h ${minutes % 60} min` : `${minutes} min ${whole % 60} s`;
}
/** Sets a text, and only if it is another one: every change is laid out and painted again. */
function put(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}
const millions = (x) => (x > 0 ? (x / 1e6).toFixed(2) : "–");
const of = (tests) => `${tests[0].toFixed(2)} node and ${tests[1].toFixed(2)} primitive tests`;
function show(next) {
  status = next;
  document.title = `${next.title} – Antumbra`;
  document.body.dataset.phase = next.phase;
  document.body.dataset.samples = next.samples;
  document.body.dataset.learned = next.learned;
  put("title", next.title);
  const triangles = next.triangles ? `, ${next.triangles.toLocaleString("en")} triangles` : "";
  put("text", next.text + (next.learned ? ", tree learned from this camera" : "") + triangles);
  put("samples", next.spp ? `${next.samples} of ${next.spp}` : "–");
  put("elapsed", time(next.elapsed));
  put("remaining", time(next.remaining));
  put("pace", millions(next.samples_per_second));
  put("rays", millions(next.rays_per_second));
  $("done").style.width = next.spp ? `${(100 * next.samples) / next.spp}%` : "0";
  put("stop", next.phase === "stopped" ? "Go on" : "Stop");
  $("stop").disabled = next.phase === "finished" || next.phase === "loading";
  $("whole").disabled = !next.cropped;
  const map = next.mode === "before" || next.mode === "after", sun = next.mode === "hours" || next.mode === "shadows";
  $("legend").hidden = $("what").hidden = !map;
  if (sunShown !== sun) {
    // Colours of hours stay as they are.
    sunShown = sun;
    expose(stops);
  }
  $("exposure").disabled = map || sun;
  $("exr").setAttribute("aria-disabled", map);
  const lines = [];
  if (next.before) lines.push(`Before: ${of(next.before)}.`);
  if (next.after) lines.push(`After: ${of(next.after)}.`);
  if (next.mode === "after" && !next.learned) lines.push("Learning from this camera; the map changes then.");
  $("tests").hidden = !map || !lines.length;
  $("tests").textContent = lines.join(" ");
  const button = document.querySelector(`input[name=mode][value=${next.mode}]`);
  if (button && !sending) button.checked = true;
  // Another viewer may have moved the camera.
  if (next.look && !sending && !pointers.size) look = next.look;
  put("samplesname", sun ? "Suns" : "Samples");
  showPose();
  showSun(next);
}
function showPose() {
  if (!look) return;
  // Nobody sees it while its section is closed.
  if (!document.querySelector("details").open) return;
  const text = (v, digits = 5) => v.map((x) => Number(x.toPrecision(digits))).join(" ");
  // Cameras are measured from the origin of the scene, which is far from that of the world in map coordinates.
  const origin = status.origin, digits = origin.some((x) => x) ? 11 : 5;
  const [eye, at] = [look.eye, look.at].map((v) => text(add(v, origin), digits));
  $("pose").textContent = `LookAt ${eye}  ${at}  ${text(look.up)}, fov ${look.fov}`;
}
function paint() {
  if (picture.dirty) {
    if (picture.frame && picture.frame.map) {
      const wanted = picture.range();
      // A range that follows every tile would flicker.
      // Both maps of a camera have one range, so that they can be compared.
      const shared = status.mode === "after" && status.before ? rangeBefore : 0;
      if (shared && range !== shared) {
        range = shared;
        picture.touch(0, picture.frame.rows);
      } else if (shared) {
        // It stays.
      } else if (wanted > range * 1.15 || wanted < range / 1.5) {
        range = wanted;
        picture.touch(0, picture.frame.rows);
      }
      if (status.mode === "before") rangeBefore = range;
      $("high").textContent = `${range.toFixed(0)} tests`;
    }
    if (picture.draw(range)) drawn++;
  }
  const now = performance.now();
  if (now - since > 1000) {
    $("updates").textContent = ((1000 * drawn) / (now - since)).toFixed(0);
    document.body.dataset.updates = ((1000 * drawn) / (now - since)).toFixed(1);
    drawn = 0;
    since = now;
  }
  requestAnimationFrame(paint);
}
/** Fits the picture into the stage. Small pictures are magnified, up to three times. */
function fit() {
  const frame = picture.frame, stage = $("stage");
  if (!frame) return;
  const phone = matchMedia("(max-width: 760px)").matches;
  const room = [stage.clientWidth, phone ? 0.62 * innerHeight : stage.clientHeight];
  const scale = Math.min(3, room[0] / frame.columns, room[1] / frame.rows);
  canvas.style.width = `${Math.max(1, Math.floor(scale * frame.columns))}px`;
  canvas.style.height = `${Math.max(1, Math.floor(scale * frame.rows))}px`;
  mark();
}
addEventListener("resize", fit);
function expose(value) {
  stops = Math.max(-8, Math.min(8, value));
  $("exposure").value = stops;
  $("stops").textContent = `${stops > 0 ? "+" : ""}${stops.toFixed(1)} EV`;
  $("png").href = `picture.png?ev=${sunShown ? 0 : stops}`;
  setExposure(sunShown ? 0 : stops);
  if (picture.frame) picture.touch(0, picture.frame.rows);
}

// Mouse, fingers and keys.
const canvas = $("picture"), pointers = new Map();
let start = null, pressed = null;
const side = () => Math.min(canvas.clientWidth, canvas.clientHeight) || 1;
function place(event) {
  const box = canvas.getBoundingClientRect();
  return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height].map((t) => Math.min(1, Math.max(0, t)));
}
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, [event.clientX, event.clientY]);
  if (cropping) start = place(event);
  // A second finger makes no click.
  pressed = pointers.size === 1 && !event.shiftKey && event.button === 0 ? [event.clientX, event.clientY] : null;
});
canvas.addEventListener("pointermove", (event) => {
  const last = pointers.get(event.pointerId);
  if (!last || !look) return;
  const now = [event.clientX, event.clientY];
  if (cropping) {
    outline(start, place(event));
    return;
  }
  const [dx, dy] = sub(now, last);
  // Hands tremble: a click turns nothing.
  if (pressed && showsSun() && Math.hypot(...sub(now, pressed)) < 4) return;
  if (pointers.size === 2) {
    const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
    const before = Math.hypot(...sub(last, other)), after = Math.hypot(...sub(now, other));
    const length = pixelLength(look, side()) / 2;
    move(nearer(walk(look, status.mirrored, -dx * length, dy * length, 0), before / Math.max(1, after)));
  } else if (event.shiftKey || event.buttons & 6) {
    const length = pixelLength(look, side());
    move(walk(look, status.mirrored, -dx * length, dy * length, 0));
  } else {
    move(orbit(look, status.mirrored, (dx / side()) * 3, (dy / side()) * 3));
  }
  pointers.set(event.pointerId, now);
});
function release(event) {
  pointers.delete(event.pointerId);
  const f = picture.frame;
  if (!cropping && pressed && event.type === "pointerup" && f && showsSun()) {
    const [dx, dy] = sub([event.clientX, event.clientY], pressed), [u, v] = place(event);
    if (Math.hypot(dx, dy) < 4) pick([(f.left + u * f.columns) / f.width, (f.above + v * f.rows) / f.height]);
  }
  pressed = null;
  if (!cropping || !start) return;
  const [a, b] = [start, place(event)];
  start = null;
  $("frame").hidden = true;
  setCropping(false);
  if (event.type !== "pointerup" || Math.abs(a[0] - b[0]) < 0.01 || Math.abs(a[1] - b[1]) < 0.01) return;
  // Inside of the part that is shown, in fractions of the whole.
  const x = [a[0], b[0]].sort((p, q) => p - q).map((t) => (f.left + t * f.columns) / f.width);
  const y = [a[1], b[1]].sort((p, q) => p - q).map((t) => (f.above + t * f.rows) / f.height);
  wish({ crop: [...x, ...y].map((t) => Math.min(1, Math.max(0, t))) });
}
canvas.addEventListener("pointerup", release);
canvas.addEventListener("pointercancel", release);
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  if (look) move(nearer(look, Math.exp(Math.max(-200, Math.min(200, event.deltaY)) * 0.0015)));
}, { passive: false });
function outline(a, b) {
  const box = canvas.getBoundingClientRect(), stage = $("stage").getBoundingClientRect();
  const style = $("frame").style;
  $("frame").hidden = false;
  style.left = `${box.left - stage.left + Math.min(a[0], b[0]) * box.width}px`;
  style.top = `${box.top - stage.top + Math.min(a[1], b[1]) * box.height}px`;
  style.width = `${Math.abs(a[0] - b[0]) * box.width}px`;
  style.height = `${Math.abs(a[1] - b[1]) * box.height}px`;
}
function setCropping(on) {
  cropping = on;
  $("crop").setAttribute("aria-pressed", on);
  canvas.classList.toggle("cropping", on);
  if (!on) $("frame").hidden = true;
}
const KEYS = {
  w: (l, m, d) => walk(l, m, 0, 0, d), s: (l, m, d) => walk(l, m, 0, 0, -d),
  a: (l, m, d) => walk(l, m, -d, 0, 0), d: (l, m, d) => walk(l, m, d, 0, 0),
  e: (l, m, d) => walk(l, m, 0, d, 0), q: (l, m, d) => walk(l, m, 0, -d, 0),
  arrowleft: (l, m) => head(l, m, -0.05, 0), arrowright: (l, m) => head(l, m, 0.05, 0),
  arrowup: (l, m) => head(l, m, 0, 0.05), arrowdown: (l, m) => head(l, m, 0, -0.05),
};
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.target.matches("input, summary") && event.key.startsWith("Arrow")) return;
  const key = event.key.toLowerCase();
  if (KEYS[key] && look) {
    event.preventDefault();
    move(KEYS[key](look, status.mirrored, norm(sub(look.at, look.eye)) * 0.05));
  } else if (key === "r") wish({ home: true, look: undefined });
  else if (key === "c") setCropping(!cropping);
  else if (key === "escape") cropping ? setCropping(false) : status.cropped && wish({ whole: true, crop: undefined });
  else if (key === "+" || key === "=") expose(stops + 0.5);
  else if (key === "-") expose(stops - 0.5);
});

// Buttons.
document.querySelector("details").addEventListener("toggle", showPose);
$("home").addEventListener("click", () => wish({ home: true, look: undefined }));
$("crop").addEventListener("click", () => setCropping(!cropping));
$("whole").addEventListener("click", () => wish({ whole: true, crop: undefined }));
$("stop").addEventListener("click", () => wish({ stopped: status.phase !== "stopped" }));
$("exposure").addEventListener("input", (event) => expose(Number(event.target.value)));
$("exposure").addEventListener("dblclick", () => expose(0));
$("quit").addEventListener("click", async () => {
  if (!confirm("End the program? A picture that is not saved is lost.")) return;
  ended = true;
  await fetch("quit", { method: "POST" }).catch(() => {});
});
for (const button of document.querySelectorAll("input[name=mode]")) {
  button.addEventListener("change", () => wish({ mode: button.value }));
}
const ramp = $("ramp").getContext("2d");
RAMP.forEach(([r, g, b], x) => {
  ramp.fillStyle = `rgb(${r} ${g} ${b})`;
  ramp.fillRect(x, 0, 1, 1);
});
$("exr").href = "picture.exr";
