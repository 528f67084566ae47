// Pixels as they came, in 16-bit floats, and their way to the screen. The server puts RAMP, 256 colours, before this file.
/** Number of a 16-bit float. */
function halfNumber(bits) {
  const [sign, exponent, mantissa] = [bits >> 15 ? -1 : 1, (bits >> 10) & 31, bits & 1023];
  if (exponent === 0) return (sign * mantissa) / 16777216;
  if (exponent === 31) return mantissa ? NaN : sign * Infinity;
  return sign * Math.pow(2, exponent - 15) * (1 + mantissa / 1024);
}
const HALVES = new Float32Array(65536).map((_, bits) => halfNumber(bits));
/** Byte of the screen for every 16-bit float, at an exposure: the curve of sRGB. */
const curve = new Uint8ClampedArray(65536);
function setExposure(stops) {
  const factor = Math.pow(2, stops);
  for (let bits = 0; bits < 65536; bits++) {
    const x = Math.min(1, Math.max(0, HALVES[bits] * factor)) || 0;
    curve[bits] = Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * Math.pow(x, 1 / 2.4) - 0.055));
  }
}
/** The picture on a canvas. */
class Picture {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.frame = null;
    this.bits = null;
    this.top = 0;
    this.dirty = null;
  }

  /** Begins a frame. Pixels of the old one stay until new ones come, if the picture has the same place. */
  begin(frame) {
    const s = frame.scale;
    const x0 = Math.min(frame.x0 * s, frame.width), y0 = Math.min(frame.y0 * s, frame.height);
    const width = Math.max(1, Math.min(frame.x1 * s, frame.width) - x0), height = Math.max(1, Math.min(frame.y1 * s, frame.height) - y0);
    const old = this.frame;
    frame.left = x0;
    frame.above = y0;
    const near = old && Math.abs(old.columns - width) < 16 && Math.abs(old.rows - height) < 16;
    const keep = near && old.map === frame.map && old.width === frame.width && (s > 1 || (old.columns === width && old.rows === height));
    if (near && s > 1) {
      // Coarse pixels end a little beside the edges of the picture.
      frame.columns = old.columns;
      frame.rows = old.rows;
      frame.left = old.left;
      frame.above = old.above;
    } else {
      frame.columns = width;
      frame.rows = height;
    }
    if (!keep || !this.bits || this.bits.length !== frame.columns * frame.rows * 3) {
      this.bits = new Uint16Array(frame.columns * frame.rows * 3);
      if (this.canvas.width !== frame.columns) this.canvas.width = frame.columns;
      if (this.canvas.height !== frame.rows) this.canvas.height = frame.rows;
      this.image = this.context.createImageData(frame.columns, frame.rows);
      this.image.data.fill(255);
      this.touch(0, frame.rows);
    }
    if (!frame.map || !old || !old.map || s > 1) this.top = frame.map ? 0 : this.top;
    this.frame = frame;
  }

  /** Takes tiles: x, y, width and height each, then their values. */
  tiles(view, at, end) {
    const { frame, bits } = this;
    if (!frame) return;
    const s = frame.scale, each = frame.map ? 1 : 3;
    while (at + 16 <= end) {
      const [x, y, w, h] = [0, 4, 8, 12].map((k) => view.getInt32(at + k, true));
      at += 16;
      for (let row = 0; row < h; row++) {
        for (let column = 0; column < w; column++, at += 2 * each) {
          const r = view.getUint16(at, true);
          const g = each === 3 ? view.getUint16(at + 2, true) : r;
          const b = each === 3 ? view.getUint16(at + 4, true) : r;
          if (each === 1) this.top = Math.max(this.top, HALVES[r] || 0);
          const px = (x + column) * s - frame.left, py = (y + row) * s - frame.above;
          for (let v = Math.max(0, py); v < Math.min(frame.rows, py + s); v++) {
            for (let u = Math.max(0, px); u < Math.min(frame.columns, px + s); u++) {
              const place = 3 * (v * frame.columns + u);
              bits[place] = r;
              bits[place + 1] = g;
              bits[place + 2] = b;
            }
          }
        }
      }
      this.touch(y * s - frame.above, (y + h) * s - frame.above);
    }
  }

  /** Rows that are to be drawn again. */
  touch(first, end) {
    this.dirty = this.dirty ? [Math.min(this.dirty[0], first), Math.max(this.dirty[1], end)] : [first, end];
  }

  /** Value at the light end of a map: what nine in ten pixels stay below, doubled. Outliers would hide the rest. */
  range() {
    const values = [];
    for (let place = 0; place < this.bits.length; place += 3 * 7) values.push(HALVES[this.bits[place]]);
    values.sort((a, b) => a - b);
    return Math.max(1, Math.min(this.top, 2 * values[Math.floor(0.9 * (values.length - 1))]));
  }

  /** Draws what has changed. Returns whether anything had. */
  draw(range) {
    if (!this.dirty || !this.frame) return false;
    const { columns, rows, map } = this.frame;
    const first = Math.max(0, this.dirty[0]), end = Math.min(rows, this.dirty[1]);
    this.dirty = null;
    if (first >= end) return false;
    const { bits, image } = this, data = image.data;
    for (let pixel = first * columns; pixel < end * columns; pixel++) {
      const place = 3 * pixel, to = 4 * pixel;
      if (map) {
        const colour = RAMP[Math.min(255, Math.max(0, Math.round((255 * HALVES[bits[place]]) / range)))] || RAMP[0];
        data[to] = colour[0];
        data[to + 1] = colour[1];
        data[to + 2] = colour[2];
      } else {
        data[to] = curve[bits[place]];
        data[to + 1] = curve[bits[place + 1]];
        data[to + 2] = curve[bits[place + 2]];
      }
    }
    this.context.putImageData(image, 0, 0, 0, first, columns, end - first);
    return true;
  }
}
