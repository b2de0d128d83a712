// A map of tracks that can be zoomed, and what is known of them over time. No library, no network.
//
// drawTracks(root, reports): `reports` are those of `evaluate` (data/track_*.json), each with a `colour`.
"use strict";

const DECISIONS = {
  accepted: "#009e73", inflated: "#e69f00", bias_compensated: "#cc79a7", not_examined: "#8a8a8a", unknown: "#c2a878",
};
const REJECTED = "#c1121f";
const STATES = { "tracking": "#009e73", "dead reckoning": "#e69f00", "lost": "#c1121f" };
const WAITING = "#bbbbbb";
const INSIDE_95 = Math.sqrt(5.991464547);  // of two dimensions
const LONGEST_LINE_S = 1.0;  // between two points of a track that are joined

const isRejected = decision => decision.startsWith("rejected");
const colourOf = decision => isRejected(decision) ? REJECTED : DECISIONS[decision] || DECISIONS.unknown;
const isKnown = value => value !== null && Number.isFinite(value);
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const plain = value => Number(value.toPrecision(3)).toString();

/// A child of `parent`.
function element(parent, tag, text = "", attributes = {}) {
  const child = document.createElement(tag);
  child.textContent = text;
  Object.assign(child, attributes);
  parent.appendChild(child);
  return child;
}

/// A canvas that fills its width, and its context in pixels of the page.
class Surface {
  constructor(parent, height, redraw) {
    this.canvas = element(parent, "canvas");
    this.canvas.style.height = height + "px";
    this.height = height;
    this.redraw = redraw;
    new ResizeObserver(() => this.request()).observe(this.canvas);
  }
  get width() { return this.canvas.clientWidth; }
  request() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      const ratio = window.devicePixelRatio || 1;
      this.canvas.width = Math.round(this.width * ratio);
      this.canvas.height = Math.round(this.height * ratio);
      const context = this.canvas.getContext("2d");
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.font = "12px sans-serif";
      this.redraw(context, this.width, this.height);
    });
  }
  /// Wheel and two fingers zoom about a place, one finger or button drags.
  listen({ zoom, drag, hover, leave }) {
    const pointers = new Map();
    const at = event => {
      const box = this.canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    this.canvas.style.touchAction = "none";
    this.canvas.addEventListener("wheel", event => {
      event.preventDefault();
      zoom(...at(event), Math.exp(-0.0015 * event.deltaY));
    }, { passive: false });
    this.canvas.addEventListener("pointerdown", event => {
      this.canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, at(event));
    });
    for (const name of ["pointerup", "pointercancel"]) {
      this.canvas.addEventListener(name, event => pointers.delete(event.pointerId));
    }
    this.canvas.addEventListener("pointerleave", leave);
    this.canvas.addEventListener("pointermove", event => {
      const now = at(event), before = pointers.get(event.pointerId);
      if (!before) return hover(...now);
      if (pointers.size === 1) drag(now[0] - before[0], now[1] - before[1]);
      if (pointers.size === 2) {
        const [other] = [...pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
        const distance = place => Math.hypot(place[0] - other[0], place[1] - other[1]);
        zoom(...other, distance(now) / Math.max(distance(before), 1));
      }
      pointers.set(event.pointerId, now);
    });
  }
}

/// Round distances for grids: 1, 2 or 5 times a power of ten, at least `least`.
function roundStep(least) {
  const power = Math.pow(10, Math.floor(Math.log10(least)));
  return [1, 2, 5, 10].find(step => step * power >= least) * power;
}

/// The index of the last entry that is not after `t`, in ascending values; -1 before the first.
function indexAt(values, t) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= t) low = middle + 1; else high = middle;
  }
  return low - 1;
}

/// Lines through points that are close in time; `place` maps an index to pixels.
function strokeLine(context, t, place, begin = 0, end = t.length) {
  context.beginPath();
  let last = NaN;
  for (let i = begin; i < end; ++i) {
    const point = place(i);
    if (!point) { last = NaN; continue; }
    if (t[i] - last <= LONGEST_LINE_S) context.lineTo(...point); else context.moveTo(...point);
    last = t[i];
  }
  context.stroke();
}

/// A disc, or a cross for what was rejected.
function mark(context, x, y, decision, radius) {
  context.beginPath();
  if (isRejected(decision)) {
    context.strokeStyle = REJECTED;
    context.moveTo(x - radius, y - radius);
    context.lineTo(x + radius, y + radius);
    context.moveTo(x + radius, y - radius);
    context.lineTo(x - radius, y + radius);
    context.stroke();
  } else {
    context.fillStyle = colourOf(decision);
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fill();
  }
}

/// What map and plots share: the time that is looked at, the layers that are shown.
class View {
  constructor(reports) {
    this.reports = reports;
    const start = Math.min(...reports.map(report => report.start));
    for (const report of reports) {
      const shift = report.start - start;
      if (shift === 0) continue;
      for (const part of ["estimate", "fixes", "states", "truth", "errors", "fix_errors"]) {
        report[part].t = report[part].t.map(t => t + shift);
      }
      for (const gaps of ["gaps", "gaps_of_fixes"]) report[gaps] = report[gaps].map(gap => gap.map(t => t + shift));
    }
    this.shown = { estimates: true, truth: true, fixes: true, ellipses: true };
    this.hidden = new Set();  // names of reports
    const says = report => report.fixes.decision.some(decision => decision !== "unknown");
    this.chosen = reports.find(says) || reports[0];  // whose decisions the fixes have
    this.cursor = null;       // s
    this.surfaces = [];
  }
  visible() { return this.reports.filter(report => !this.hidden.has(report.name)); }
  request() { for (const surface of this.surfaces) surface.request(); }
  look(t) { this.cursor = t; this.request(); }
}

class TrackMap {
  constructor(view, parent, tip) {
    this.view = view;
    this.tip = tip;
    this.surface = new Surface(parent, 520, (context, width, height) => this.draw(context, width, height));
    view.surfaces.push(this.surface);
    this.surface.listen({
      zoom: (x, y, factor) => this.zoom(x, y, factor),
      drag: (dx, dy) => { this.x -= dx / this.scale; this.y += dy / this.scale; this.tip.textContent = ""; view.request(); },
      hover: (x, y) => this.hover(x, y),
      leave: () => view.look(null),
    });
    this.surface.canvas.addEventListener("dblclick", () => this.fit());
  }
  /// Shows the truth and the estimates, or if there is neither the fixes.
  fit() {
    const collect = parts => {
      const points = { x: [], y: [] };
      for (const part of parts) for (const axis of ["x", "y"]) for (const v of part[axis]) if (isKnown(v)) points[axis].push(v);
      return points;
    };
    let points = collect(this.view.reports.flatMap(report => [report.truth, report.estimate]));
    if (!points.x.length) points = collect(this.view.reports.map(report => report.fixes));
    const range = values => values.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [Infinity, -Infinity]);
    const [west, east] = points.x.length ? range(points.x) : [-10, 10];
    const [south, north] = points.y.length ? range(points.y) : [-10, 10];
    const room = 1.15;
    this.x = (west + east) / 2;
    this.y = (south + north) / 2;
    this.scale = Math.min(this.surface.width / Math.max(room * (east - west), 20),
                          this.surface.height / Math.max(room * (north - south), 20));
    this.view.request();
  }
  zoom(x, y, factor) {
    const next = clamp(this.scale * factor, 1e-4, 1e3);
    const [east, north] = this.place(x, y);
    this.scale = next;
    this.x = east - (x - this.surface.width / 2) / next;
    this.y = north + (y - this.surface.height / 2) / next;
    this.view.request();
  }
  place(x, y) {
    return [this.x + (x - this.surface.width / 2) / this.scale, this.y - (y - this.surface.height / 2) / this.scale];
  }
  pixel(x, y) {
    if (!isKnown(x) || !isKnown(y)) return null;
    return [this.surface.width / 2 + (x - this.x) * this.scale, this.surface.height / 2 - (y - this.y) * this.scale];
  }
  inside(point) {
    return point && point[0] > -20 && point[1] > -20 && point[0] < this.surface.width + 20 && point[1] < this.surface.height + 20;
  }
  draw(context, width, height) {
    if (!this.scale) return this.fit();
    this.drawGrid(context, width, height);
    const { shown, chosen, cursor } = this.view;
    if (shown.fixes) {
      context.globalAlpha = 0.75;
      context.lineWidth = 1.5;
      const fixes = chosen.fixes;
      fixes.t.forEach((_, i) => {
        const point = this.pixel(fixes.x[i], fixes.y[i]);
        if (this.inside(point)) mark(context, ...point, fixes.decision[i], 3);
      });
      context.globalAlpha = 1;
    }
    if (shown.truth) {
      context.strokeStyle = "#000000";
      context.lineWidth = 1.5;
      const drawn = new Set();  // reports of one drive have one truth
      for (const { truth } of this.view.reports) {
        const key = truth.t.length + " " + truth.x[0] + " " + truth.y[0];
        if (drawn.has(key)) continue;
        drawn.add(key);
        strokeLine(context, truth.t, i => this.pixel(truth.x[i], truth.y[i]));
      }
    }
    if (shown.estimates) for (const report of this.view.visible()) this.drawEstimate(context, report);
    if (cursor !== null) this.drawCursor(context);
  }
  drawGrid(context, width, height) {
    const step = roundStep(80 / this.scale);
    const [west, north] = this.place(0, 0), [east, south] = this.place(width, height);
    context.fillStyle = "#777777";
    context.strokeStyle = "#e8e8e8";
    context.lineWidth = 1;
    context.beginPath();
    for (let x = Math.ceil(west / step) * step; x < east; x += step) {
      const [px] = this.pixel(x, 0);
      context.moveTo(px, 0);
      context.lineTo(px, height);
      if (px < width - 90) context.fillText(plain(x), px + 3, height - 5);
    }
    for (let y = Math.ceil(south / step) * step; y < north; y += step) {
      const [, py] = this.pixel(0, y);
      context.moveTo(0, py);
      context.lineTo(width, py);
      if (py > 28) context.fillText(plain(y), 3, py - 3);  // below "m north"
    }
    context.stroke();
    context.fillText("m east", width - 42, height - 5);
    context.fillText("m north", 3, 12);
  }
  drawEstimate(context, report) {
    const e = report.estimate;
    context.strokeStyle = report.colour;
    if (this.view.shown.ellipses) {
      context.lineWidth = 0.8;
      let last = null;
      for (let i = 0; i < e.t.length; ++i) {
        const point = this.pixel(e.x[i], e.y[i]);
        if (!this.inside(point) || last && Math.hypot(point[0] - last[0], point[1] - last[1]) < 30) continue;
        last = point;
        this.drawEllipse(context, point, e.xx[i], e.xy[i], e.yy[i]);
      }
    }
    context.lineWidth = 2;
    strokeLine(context, e.t, i => this.pixel(e.x[i], e.y[i]));
  }
  /// That which holds the truth with 95 %.
  drawEllipse(context, point, xx, xy, yy) {
    if (![xx, xy, yy].every(isKnown)) return;
    const mean = (xx + yy) / 2, spread = Math.hypot((xx - yy) / 2, xy);
    const radius = variance => INSIDE_95 * Math.sqrt(Math.max(variance, 0)) * this.scale;
    if (!(radius(mean + spread) < 1e4)) return;
    context.beginPath();
    context.ellipse(...point, radius(mean + spread), radius(mean - spread), -0.5 * Math.atan2(2 * xy, xx - yy), 0, 2 * Math.PI);
    context.stroke();
  }
  drawCursor(context) {
    for (const report of this.view.visible()) {
      const i = indexAt(report.estimate.t, this.view.cursor);
      const point = i >= 0 && this.pixel(report.estimate.x[i], report.estimate.y[i]);
      if (!point) continue;
      context.fillStyle = report.colour;
      context.strokeStyle = "#ffffff";
      context.lineWidth = 2;
      context.beginPath();
      context.arc(...point, 6, 0, 2 * Math.PI);
      context.fill();
      context.stroke();
    }
  }
  /// Says what is nearest to the pointer.
  hover(x, y) {
    let best = { distance: 14 };
    const consider = (report, part, kind) => {
      for (let i = 0; i < part.t.length; ++i) {
        const point = this.pixel(part.x[i], part.y[i]);
        if (!point) continue;
        const distance = Math.hypot(point[0] - x, point[1] - y);
        if (distance < best.distance) best = { distance, report, part, kind, i };
      }
    };
    if (this.view.shown.fixes) consider(this.view.chosen, this.view.chosen.fixes, "fix");
    if (this.view.shown.estimates) for (const report of this.view.visible()) consider(report, report.estimate, "estimate");
    this.tip.textContent = best.part ? describe(best) : "";
    this.view.look(best.part ? best.part.t[best.i] : null);
  }
}

/// One line about a point of a track.
function describe({ report, part, kind, i }) {
  const number = (name, value, unit) => isKnown(value) ? `, ${name} ${plain(value)}${unit}` : "";
  const where = `t = ${part.t[i].toFixed(1)} s, east ${part.x[i].toFixed(1)} m, north ${part.y[i].toFixed(1)} m`;
  if (kind === "estimate") {
    return `${report.name}: ${where}` + number("σ", part.sigma[i], " m") + number("speed", part.speed[i], " m/s");
  }
  const reason = part.reason[i] ? ` (${part.reason[i]})` : "";
  return `fix ${part.decision[i]}${reason}: ${where}` + number("declared σ", part.sigma[i], " m") +
    number("NIS", part.nis[i], "") + number("of at most", part.nis_threshold[i], "");
}

/// A row of plots over time.
class Plots {
  constructor(view, parent) {
    this.view = view;
    this.panels = [];
    const has = (part, column) => view.reports.some(report => report[part][column].some(isKnown));
    if (has("errors", "error")) {
      this.add("position error [m]", true, [
        { of: () => [view.chosen], part: "fix_errors", column: "error", dots: true, colour: () => DECISIONS.unknown },
        { of: () => view.visible(), part: "errors", column: "error", colour: report => report.colour }]);
    }
    this.add("claimed σ [m]", true, [
      { of: () => [view.chosen], part: "fixes", column: "sigma", dots: true, colour: () => DECISIONS.unknown },
      { of: () => view.visible(), part: "estimate", column: "sigma", colour: report => report.colour }]);
    if (has("fixes", "nis")) {
      this.add("NIS of fixes", true, [
        { of: () => [view.chosen], part: "fixes", column: "nis_threshold", colour: () => "#888888" },
        { of: () => [view.chosen], part: "fixes", column: "nis", dots: true, byDecision: true }]);
    }
    this.add("speed [m/s]", false, [
      { of: () => view.visible(), part: "estimate", column: "speed", colour: report => report.colour }]);
    const ends = view.reports.flatMap(report => [report.estimate, report.fixes, report.truth]).map(part => part.t).filter(t => t.length);
    this.whole = [Math.min(...ends.map(t => t[0])), Math.max(...ends.map(t => t[t.length - 1]), 1)];
    [this.begin, this.end] = this.whole;
    const stated = view.reports.some(report => report.states.t.length);
    this.strip = stated ? 26 : 0;
    this.surface = new Surface(parent, 120 * this.panels.length + this.strip + 30,
                               (context, width) => this.draw(context, width));
    view.surfaces.push(this.surface);
    this.surface.listen({
      zoom: (x, y, factor) => this.zoom(x, factor),
      drag: dx => this.move(-dx * (this.end - this.begin) / (this.surface.width - 80)),
      hover: x => view.look(clamp(this.time(x), ...this.whole)),
      leave: () => view.look(null),
    });
    this.surface.canvas.addEventListener("dblclick", () => { [this.begin, this.end] = this.whole; view.request(); });
  }
  add(label, logarithmic, series) { this.panels.push({ label, logarithmic, series }); }
  time(x) { return this.begin + (x - 70) / (this.surface.width - 80) * (this.end - this.begin); }
  x(t) { return 70 + (t - this.begin) / (this.end - this.begin) * (this.surface.width - 80); }
  zoom(x, factor) {
    const t = this.time(x);
    const [low, high] = this.whole;
    this.begin = Math.max(low, t - (t - this.begin) / factor);
    this.end = Math.min(high, t + (this.end - t) / factor);
    if (this.end - this.begin < 0.5) this.end = this.begin + 0.5;
    this.view.request();
  }
  move(seconds) {
    const [low, high] = this.whole;
    const shift = clamp(seconds, low - this.begin, high - this.end);
    this.begin += shift;
    this.end += shift;
    this.view.request();
  }
  draw(context, width) {
    const bottom = 120 * this.panels.length;
    this.panels.forEach((panel, row) => this.drawPanel(context, panel, 120 * row + 8, 104, width));
    this.drawStates(context, bottom + 4, width);
    const step = roundStep((this.end - this.begin) * 80 / (width - 80));
    context.fillStyle = "#777777";
    context.textAlign = "center";
    for (let t = Math.ceil(this.begin / step) * step; t <= this.end; t += step) {
      context.fillText(plain(t) + " s", this.x(t), bottom + this.strip + 18);
    }
    context.textAlign = "start";
    if (this.view.cursor !== null) {
      context.strokeStyle = "#c1121f";
      context.lineWidth = 1;
      context.beginPath();
      context.moveTo(this.x(this.view.cursor), 0);
      context.lineTo(this.x(this.view.cursor), bottom + this.strip);
      context.stroke();
    }
  }
  /// The values within the time that is shown.
  range(panel) {
    let low = Infinity, high = -Infinity;
    for (const { of, part, column } of panel.series) {
      for (const report of of()) {
        const { t, [column]: values } = report[part];
        for (let i = Math.max(indexAt(t, this.begin), 0); i < t.length && t[i] <= this.end; ++i) {
          if (!isKnown(values[i]) || panel.logarithmic && values[i] <= 0) continue;
          low = Math.min(low, values[i]);
          high = Math.max(high, values[i]);
        }
      }
    }
    if (low > high) return [1, 10];
    if (!panel.logarithmic) return [Math.min(low, 0), Math.max(1.1 * high, 0.1)];
    return [Math.max(low, high * 1e-4, 0.01) / 1.3, Math.max(high * 1.3, 0.05)];
  }
  drawPanel(context, panel, top, height, width) {
    const [low, high] = this.range(panel);
    const scale = panel.logarithmic ? Math.log : value => value;
    const y = value => top + height - (scale(panel.logarithmic ? Math.max(value, low) : value) - scale(low)) / (scale(high) - scale(low)) * height;
    context.save();
    context.fillStyle = "#777777";
    context.strokeStyle = "#e8e8e8";
    context.lineWidth = 1;
    context.textAlign = "end";
    for (const value of this.ticks(panel, low, high)) {
      context.beginPath();
      context.moveTo(70, y(value));
      context.lineTo(width - 10, y(value));
      context.stroke();
      context.fillText(plain(value), 66, y(value) + 4);
    }
    context.textAlign = "center";
    context.fillStyle = "#222222";
    context.translate(14, top + height / 2);
    context.rotate(-Math.PI / 2);
    context.fillText(panel.label, 0, 0);
    context.restore();
    context.save();
    context.beginPath();
    context.rect(70, top, width - 80, height);
    context.clip();
    context.fillStyle = "rgba(193, 18, 31, 0.12)";
    for (const [begin, end] of this.view.chosen.gaps_of_fixes) {
      context.fillRect(this.x(begin), top, Math.max(this.x(end) - this.x(begin), 1), height);
    }
    for (const series of panel.series) for (const report of series.of()) this.drawSeries(context, series, report, y, panel.logarithmic);
    context.restore();
    context.strokeStyle = "#bbbbbb";
    context.strokeRect(70, top, width - 80, height);
  }
  drawSeries(context, { part, column, dots, byDecision, colour }, report, y, logarithmic) {
    const { t, [column]: values } = report[part];
    const begin = Math.max(indexAt(t, this.begin), 0);
    const end = Math.min(indexAt(t, this.end) + 2, t.length);
    const known = i => isKnown(values[i]) && (!logarithmic || values[i] > 0);
    context.lineWidth = 1.4;
    if (!dots) {
      context.strokeStyle = colour(report);
      return strokeLine(context, t, i => known(i) ? [this.x(t[i]), y(values[i])] : null, begin, end);
    }
    for (let i = begin; i < end; ++i) {
      if (!known(i)) continue;
      if (!byDecision) context.fillStyle = colour(report);
      if (byDecision) mark(context, this.x(t[i]), y(values[i]), report.fixes.decision[i], 2.5);
      else context.fillRect(this.x(t[i]) - 1.2, y(values[i]) - 1.2, 2.4, 2.4);
    }
  }
  ticks(panel, low, high) {
    const ticks = [];
    if (panel.logarithmic) {
      const factors = high / low > 30 ? [1] : [1, 2, 5];
      for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); ++power) {
        for (const factor of factors) {
          const value = factor * Math.pow(10, power);
          if (value >= low && value <= high) ticks.push(value);
        }
      }
      return ticks;
    }
    const step = roundStep((high - low) / 4);
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) ticks.push(value);
    return ticks;
  }
  /// The states of the localizer, hatched pale where it is not healthy.
  drawStates(context, top, width) {
    const { t, state, healthy } = this.view.chosen.states;
    if (!t.length) return;
    context.fillStyle = "#222222";
    context.textAlign = "end";
    context.fillText("state", 66, top + 14);
    context.textAlign = "start";
    context.save();
    context.beginPath();
    context.rect(70, top, width - 80, 20);
    context.clip();
    t.forEach((begin, i) => {
      const from = this.x(begin), to = this.x(i + 1 < t.length ? t[i + 1] : this.whole[1]);
      context.globalAlpha = healthy[i] ? 1 : 0.45;
      context.fillStyle = STATES[state[i]] || WAITING;
      context.fillRect(from, top, Math.max(to - from, 1), 18);
      context.globalAlpha = 1;
      const text = state[i] + (healthy[i] ? "" : ", not healthy");
      if (to - from > 7 * text.length) {
        context.fillStyle = healthy[i] && STATES[state[i]] ? "#ffffff" : "#222222";
        context.fillText(text, Math.max(from, 70) + 5, top + 13);
      }
    });
    context.restore();
  }
}

/// Check boxes, and what the colours mean.
function addControls(parent, view, map) {
  const box = element(parent, "p", "", { className: "controls" });
  const toggle = (text, colour, checked, change) => {
    const label = element(box, "label");
    const input = element(label, "input", "", { type: "checkbox", checked });
    if (colour) element(label, "span", "", { className: "swatch" }).style.background = colour;
    label.appendChild(document.createTextNode(text));
    input.addEventListener("change", () => { change(input.checked); view.request(); });
  };
  for (const report of view.reports) {
    toggle(report.name + (report.localizer ? ` (${report.localizer})` : ""), report.colour, true, on => {
      if (on) view.hidden.delete(report.name); else view.hidden.add(report.name);
    });
  }
  if (view.reports.some(report => report.truth.t.length)) {
    toggle("truth", "#000000", true, on => { view.shown.truth = on; });
  }
  toggle("95 % ellipses", "", true, on => { view.shown.ellipses = on; });
  toggle("fixes", "", true, on => { view.shown.fixes = on; });
  if (view.reports.length > 1) {
    const label = element(box, "label", "as decided by ");
    const choice = element(label, "select");
    view.reports.forEach((report, i) => element(choice, "option", report.name, { value: i }));
    choice.value = view.reports.indexOf(view.chosen);
    choice.addEventListener("change", () => { view.chosen = view.reports[choice.value]; view.request(); addLegend(); });
  }
  element(box, "button", "whole drive").addEventListener("click", () => map.fit());
  const legend = element(parent, "p", "", { className: "controls" });
  const states = element(parent, "p", "", { className: "controls" });
  const addStates = () => {
    const { t, state, healthy, reason } = view.chosen.states;
    states.textContent = t.length ? "States: " : "";
    [...new Set(state)].forEach(name => {
      const label = element(states, "span", "", { className: "entry" });
      element(label, "span", "", { className: "swatch" }).style.background = STATES[name] || WAITING;
      label.appendChild(document.createTextNode(name));
    });
    const why = new Set(reason.filter((text, i) => text && !healthy[i]).map(text => text.replace(/; the last.*/, "")));
    if (why.size) states.appendChild(document.createTextNode("Not healthy: " + [...why].join("; ")));
  };
  const addLegend = () => {
    legend.textContent = "Fixes: ";
    const counts = {};
    for (const decision of view.chosen.fixes.decision) counts[decision] = (counts[decision] || 0) + 1;
    for (const [decision, count] of Object.entries(counts)) {
      const label = element(legend, "span", "", { className: "entry" });
      element(label, "span", isRejected(decision) ? "×" : "●").style.color = colourOf(decision);
      label.appendChild(document.createTextNode(` ${decision} ${count}`));
    }
    if (!Object.keys(counts).length) legend.textContent = "No fixes.";
    const missing = view.chosen.fixes_without_position;
    if (missing) element(legend, "span", `${missing} without a position are not drawn`, { className: "entry" });
    addStates();
  };
  addLegend();
}

function drawTracks(root, reports) {
  const view = new View(reports);
  const tools = element(root, "div");
  const tip = element(root, "p", "", { className: "tip" });
  const map = new TrackMap(view, root, tip);
  addControls(tools, view, map);
  new Plots(view, root);
}
