// Figures to read and to enlarge. The picture stays; a canvas over it shows the values under the pointer, and a part that was drawn over.
for (const figure of document.querySelectorAll("figure.curves")) {
  const plots = JSON.parse(figure.querySelector("script").textContent), pane = figure.querySelector(".pane");
  const canvas = pane.appendChild(document.createElement("canvas")), pen = canvas.getContext("2d");
  const reading = figure.insertBefore(document.createElement("p"), pane.nextSibling);
  const back = figure.insertBefore(document.createElement("button"), reading);
  reading.className = "reading"; back.textContent = "Whole figure"; back.hidden = true; back.type = "button";
  const HINT = "Point at the figure to read values; drag across it to enlarge a part.";
  reading.textContent = HINT;
  let width = 1, height = 1, start = null, at = null;
  const reset = () => { for (const p of plots) { p.xs = [...p.x.ends]; p.ys = [...p.y.ends]; p.zoomed = false; } back.hidden = true; };
  const bend = (axis, v) => axis.log ? Math.log10(Math.max(v, 1e-300)) : v;
  const part = (axis, ends, v) => (bend(axis, v) - bend(axis, ends[0])) / (bend(axis, ends[1]) - bend(axis, ends[0]));
  const box = p => ({left: p.box[0] * width, top: p.box[1] * height, width: p.box[2] * width, height: p.box[3] * height});
  const toX = (p, s, v) => { const b = box(p); return b.left + b.width * (s.across === "x" ? v : part(p.x, p.xs, v)); };
  const toY = (p, s, v) => { const b = box(p); return b.top + b.height * (1 - (s.across === "y" ? v : part(p.y, p.ys, v))); };
  const valueAt = (p, px) => {
    const b = box(p), [low, high] = p.xs.map(v => bend(p.x, v)), v = low + (high - low) * (px - b.left) / b.width;
    return p.x.log ? 10 ** v : v;
  };
  const plotAt = (x, y) => plots.find(p => { const b = box(p); return x >= b.left && x <= b.left + b.width && y >= b.top && y <= b.top + b.height; });
  const say = (v, ends, log) => {
    const size = log ? Math.abs(v) : Math.abs(ends[1] - ends[0]), places = size ? Math.floor(Math.log10(size)) : 0;
    const text = Math.abs(v) >= 1e7 || (v && Math.abs(v) < 1e-4) ? v.toPrecision(5) : v.toFixed(Math.min(12, Math.max(0, (log ? 3 : 4) - places)));
    return (text.includes(".") && !text.includes("e") ? text.replace(/\.?0+$/, "") : text).replace("-", "−");
  };
  const unit = label => (label.match(/\(([^()]*)\)\s*$/) || ["", ""])[1];

  function ticks(axis, ends, most) {
    const low = Math.min(...ends), high = Math.max(...ends), found = [];
    if (axis.log && high / low >= 20) {
      for (let k = Math.ceil(Math.log10(low)); k <= Math.log10(high); k += Math.max(1, Math.round(Math.log10(high / low) / most))) found.push([10 ** k, k > -4 && k < 5 ? String(10 ** k) : `1e${k}`]);
      return found;
    }
    const raw = (high - low) / most, size = 10 ** Math.floor(Math.log10(raw)), step = size * [1, 2, 5, 10].find(k => k * size >= raw);
    for (let k = Math.ceil(low / step); k * step <= high && found.length < 50; k++)
      found.push([k * step, (step < 1e-5 && high < 1e-2 ? (k * step).toExponential(2) : (k * step).toFixed(Math.max(0, Math.min(12, -Math.floor(Math.log10(step) + 1e-9))))).replaceAll("-", "−")]);
    return found;
  }

  function drawLarge(p) {
    const b = box(p), right = b.left + b.width, foot = b.top + b.height;
    pen.fillStyle = "#fff"; pen.fillRect(b.left, b.top, b.width, b.height);
    pen.fillRect(b.left - 7, b.top - 2, 7, b.height + 4); pen.fillRect(b.left - 2, foot, b.width + 4, 7);
    for (const [x, y, w, h] of p.clear) pen.fillRect(x * width - 2, y * height - 3, w * width + 4, h * height + 6);
    pen.font = "11px system-ui, sans-serif"; pen.lineWidth = 0.6; pen.strokeStyle = "#d5dae0";
    const labels = ticks(p.y, p.ys, Math.max(2, b.height / 45)).map(([v, text]) => [toY(p, {}, v), text]);
    for (const [y] of labels) { pen.beginPath(); pen.moveTo(b.left, y); pen.lineTo(right, y); pen.stroke(); }
    for (const [v, text] of ticks(p.x, p.xs, Math.max(2, b.width / 90))) {
      const x = toX(p, {}, v);
      pen.beginPath(); pen.moveTo(x, b.top); pen.lineTo(x, foot); pen.stroke();
      if (p.below) { pen.fillStyle = "#1b1f24"; pen.textAlign = "center"; pen.fillText(text, x, foot + 14); }
    }
    pen.save(); pen.beginPath(); pen.rect(b.left, b.top, b.width, b.height); pen.clip();
    for (const s of p.series) {
      pen.strokeStyle = pen.fillStyle = s.colour; pen.lineWidth = 1.4; pen.setLineDash(s.kind === "dash" ? [5, 4] : []);
      let down = false; pen.beginPath();
      for (let k = 0; k < s.x.length; k++) {
        if (s.x[k] === null || s.y[k] === null) { down = false; continue; }
        const x = toX(p, s, s.x[k]), y = toY(p, s, s.y[k]);
        if (s.kind === "dots") { pen.moveTo(x + 2, y); pen.arc(x, y, 2, 0, 7); } else if (down) pen.lineTo(x, y); else pen.moveTo(x, y);
        down = true;
      }
      if (s.kind === "dots" || s.kind === "area") pen.fill(); else pen.stroke();
    }
    pen.setLineDash([]); pen.restore();
    pen.strokeStyle = "#1b1f24"; pen.lineWidth = 0.8; pen.beginPath();
    pen.moveTo(b.left, b.top); pen.lineTo(b.left, foot); pen.lineTo(right, foot); pen.stroke();
    pen.textAlign = "left";
    for (const [y, text] of labels) {
      pen.strokeStyle = "#fff"; pen.lineWidth = 3; pen.strokeText(text, b.left + 4, y - 3); pen.fillStyle = "#1b1f24"; pen.fillText(text, b.left + 4, y - 3);
    }
  }

  function nearest(p, s, px, py) {
    let best = null, least = Infinity;
    for (let k = 0; k < s.x.length; k++) {
      if (s.x[k] === null || s.y[k] === null) continue;
      const dx = toX(p, s, s.x[k]) - px, dy = py === null ? 0 : toY(p, s, s.y[k]) - py, far = dx * dx + 0.05 * dy * dy;
      if (far < least) { least = far; best = k; }
    }
    return least < 2500 ? best : null;
  }

  function draw() {
    const ratio = devicePixelRatio || 1;
    [width, height] = [pane.clientWidth, pane.clientHeight];
    canvas.width = width * ratio; canvas.height = height * ratio; pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    plots.filter(p => p.zoomed).forEach(drawLarge);
    const over = at && plotAt(...(start ? start : at));
    if (!over) { reading.textContent = HINT; return; }
    if (start) {
      const b = box(over);
      pen.fillStyle = "rgba(11, 83, 148, 0.18)"; pen.fillRect(Math.min(start[0], at[0]), b.top, Math.abs(at[0] - start[0]), b.height);
    }
    const told = [`${over.x.label || (plots.find(one => one.x.label) || over).x.label || "x"} ${say(valueAt(over, at[0]), over.xs, over.x.log)}`];
    for (const p of plots.filter(one => one === over || one.group === over.group)) {
      for (const s of p.series.filter(one => !one.across && one.kind !== "area")) {
        const k = nearest(p, s, at[0], p === over ? at[1] : null);
        if (k === null) continue;
        const name = s.name || p.title || p.y.label, x = toX(p, s, s.x[k]), y = toY(p, s, s.y[k]), b = box(p);
        if (y < b.top - 1 || y > b.top + b.height + 1) continue;
        told.push(`${name} ${say(s.y[k], p.ys, p.y.log)}${unit(p.y.label) && !name.endsWith(")") ? " " + unit(p.y.label) : ""}`);
        pen.fillStyle = s.colour; pen.strokeStyle = "#fff"; pen.lineWidth = 1.5; pen.beginPath(); pen.arc(x, y, 4, 0, 7); pen.fill(); pen.stroke();
      }
    }
    reading.textContent = told.slice(0, 13).join(" · ");
  }

  function enlarge(p, from, to) {
    const ends = [valueAt(p, Math.min(from, to)), valueAt(p, Math.max(from, to))];
    for (const one of plots.filter(other => other.group === p.group)) {
      one.xs = ends; one.zoomed = true;
      const seen = one.series.filter(s => !s.across).flatMap(s => s.y.filter((y, k) => y !== null && s.x[k] >= Math.min(...ends) && s.x[k] <= Math.max(...ends)))
        .filter(y => !one.y.log || y > 0).map(y => bend(one.y, y));
      if (!seen.length) continue;
      const low = seen.reduce((a, b) => Math.min(a, b)), high = seen.reduce((a, b) => Math.max(a, b)), room = 0.06 * (high - low || Math.abs(high) || 1);
      one.ys = [low - room, high + room].map(v => one.y.log ? 10 ** v : v);
    }
    back.hidden = false;
  }

  const place = event => { const r = canvas.getBoundingClientRect(); return [event.clientX - r.left, event.clientY - r.top]; };
  canvas.addEventListener("pointerdown", event => { at = place(event); start = plotAt(...at) ? at : null; canvas.setPointerCapture?.(event.pointerId); draw(); });
  canvas.addEventListener("pointermove", event => { at = place(event); draw(); });
  canvas.addEventListener("pointerup", event => {
    at = place(event);
    if (start && Math.abs(at[0] - start[0]) > 8) enlarge(plotAt(...start), start[0], at[0]);
    start = null; draw();
  });
  for (const end of ["pointercancel", "pointerleave"]) canvas.addEventListener(end, () => { start = at = null; draw(); });
  for (const whole of [[canvas, "dblclick"], [back, "click"]]) whole[0].addEventListener(whole[1], () => { reset(); draw(); });
  new ResizeObserver(draw).observe(pane); reset(); draw();
}
