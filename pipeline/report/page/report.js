// Draws statistics.json. All numbers were computed by the program; only the threshold explorer (explorer.js) counts.
// Every text from the dataset goes through textContent or through plain(), since Plotly reads some HTML tags.

const statistics = JSON.parse(document.getElementById("statistics").textContent);
const pictures = JSON.parse(document.getElementById("pictures").textContent);

// Colours that people with any common kind of colour blindness tell apart (Okabe and Ito).
const FAMILY_COLOURS = {
  felidae: "#0072b2", canidae: "#e69f00", equidae: "#009e73", bovidae: "#d55e00", hippopotamidae: "#cc79a7",
  none: "#7f8893",
};
const VERDICT_COLOURS = { retained: "#0072b2", refined: "#e69f00", discarded: "#9aa2ad", failed: "#d55e00" };
const INK = "#1c2430";

const byId = (id) => document.getElementById(id);
const percent = (share, digits = 1) => (share === null ? "-" : (100 * share).toFixed(digits) + " %");
const whole = (number) => number.toLocaleString("en-US");
const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const pale = (colour) => colour + "55";
const rgbaOf = (families, colour) => families.map((family) => colour(FAMILY_COLOURS[family] || FAMILY_COLOURS.none));

function element(tag, text, className) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (className) made.className = className;
  return made;
}

function tile(parent, value, label, colour) {
  const made = element("div", undefined, "tile");
  made.append(element("b", value), element("span", label));
  if (colour) made.style.borderLeftColor = colour;
  parent.append(made);
  return made;
}

// rows: lists of cells; a number is set to the right.
function fillTable(table, head, rows) {
  const isNumber = (column) => rows.length > 0 && rows.every((row) => typeof row[column] !== "string" || row[column] === "-" || /^[\d.,]+( %)?$/.test(row[column]));
  const addRow = (cells, tag) => {
    const row = element("tr");
    cells.forEach((cell, i) => row.append(element(tag, typeof cell === "number" ? whole(cell) : cell, isNumber(i) ? "number" : "")));
    table.append(row);
  };
  addRow(head, "th");
  rows.forEach((row) => addRow(row, "td"));
}

function draw(id, traces, layout = {}) {
  const narrow = window.innerWidth < 720;
  const base = {
    font: { family: "system-ui, DejaVu Sans, sans-serif", size: narrow ? 11 : 13, color: INK },
    margin: { l: 60, r: 16, t: 36, b: 50 }, hovermode: "closest",
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
  };
  const axis = { gridcolor: "#e6e9ee", zerolinecolor: "#c9ced6", automargin: true };
  const merged = { ...base, ...layout };
  merged.xaxis = { ...axis, ...(layout.xaxis || {}) };
  merged.yaxis = { ...axis, ...(layout.yaxis || {}) };
  return Plotly.newPlot(id, traces, merged, { responsive: true, displaylogo: false, displayModeBar: narrow ? false : "hover" });
}

function nothing(id, text) {
  const chart = byId(id);
  chart.style.height = "auto";
  chart.append(element("p", text));
}

function drawHead() {
  const dataset = statistics.dataset, counts = statistics.counts;
  document.title = `${dataset.name} ${dataset.version}: report`;
  byId("name").textContent = `${dataset.name} ${dataset.version}`;
  byId("identity").textContent = `${dataset.folder}, content ${dataset.content_id.slice(0, 16)}, profile ${dataset.profile}, ${dataset.shards} shards, made by quadruped3d ${dataset.toolkit}`;
  tile(byId("counts"), whole(counts.candidates), "candidates");
  for (const verdict of ["retained", "refined", "discarded", "failed"]) {
    const share = counts.candidates ? counts[verdict] / counts.candidates : null;
    tile(byId("counts"), whole(counts[verdict]), `${verdict}, ${percent(share)}`, VERDICT_COLOURS[verdict]);
  }
  for (const line of statistics.warnings) byId("warnings").append(element("p", textOf(line), "warning"));
  for (const section of document.querySelectorAll("main section")) {
    if (section.hidden) continue;
    const link = element("a", section.querySelector("h2").textContent);
    link.href = "#" + section.id;
    byId("contents").append(link);
  }
}

// A warning or note is a sentence, or an object that holds one.
function textOf(line) {
  if (typeof line === "string") return line;
  return line.text || line.message || JSON.stringify(line);
}

function drawFunnel() {
  const steps = statistics.funnel;
  draw("chart-funnel", [{
    type: "funnel", y: steps.map((s) => s.step), x: steps.map((s) => s.count), textinfo: "value+percent initial",
    hovertext: steps.map((s) => plain(s.meaning)), hoverinfo: "text", marker: { color: "#0072b2" },
    connector: { fillcolor: "#dfe9f2" }, textfont: { color: "#ffffff" }, outsidetextfont: { color: INK },
  }], { margin: { l: 90, r: 16, t: 10, b: 10 } });
  const reasons = [...statistics.reasons].reverse();
  if (reasons.length === 0) return nothing("chart-reasons", "No candidate was discarded and none failed.");
  byId("chart-reasons").style.height = Math.max(160, 60 + 30 * reasons.length) + "px";
  draw("chart-reasons", [{
    type: "bar", orientation: "h", y: reasons.map((r) => r.reason), x: reasons.map((r) => r.count),
    text: reasons.map((r) => whole(r.count)), textposition: "auto", cliponaxis: false,
    hovertext: reasons.map((r) => plain(r.meaning)), hoverinfo: "text",
    marker: { color: reasons.map((r) => VERDICT_COLOURS[r.verdict]) },
  }], { margin: { l: 150, r: 40, t: 10, b: 40 }, xaxis: { title: { text: "candidates" } } });
}

function drawDatasets() {
  fillTable(byId("table-datasets"), ["dataset", "candidates", "retained", "refined", "discarded", "failed", "yield"],
    statistics.groups.datasets.map((d) => [d.name, d.candidates, d.retained, d.refined, d.discarded, d.failed, percent(d.yield && d.yield.share)]));
}

function drawFamilies() {
  const families = statistics.groups.families;
  const names = families.map((f) => f.name);
  const bars = (key, colour, name) => ({
    type: "bar", name, x: names, y: families.map((f) => 100 * f[key]), marker: { color: rgbaOf(names, colour) },
    hovertemplate: "%{x}: %{y:.1f} % of all " + name + "<extra></extra>",
  });
  draw("chart-families", [bars("share_before", pale, "candidates"), bars("share_after", (c) => c, "labels")],
    { barmode: "group", showlegend: false, yaxis: { title: { text: "share, %" } }, title: { text: "families: candidates (pale) and labels", font: { size: 14 } } });
  const said = (what, ratio) => `${what}: ${ratio.before.ratio ?? "-"} among candidates (${whole(ratio.before.largest)} : ${whole(ratio.before.smallest)}), ${ratio.after.ratio ?? "-"} among labels (${whole(ratio.after.largest)} : ${whole(ratio.after.smallest)})${ratio.after.lost ? `; ${ratio.after.lost} lost all their candidates` : ""}`;
  const imbalance = statistics.groups.imbalance;
  byId("imbalance").textContent = `Imbalance ratio. ${said("Species", imbalance.species)}. ${said("Families", imbalance.families)}.`;
}

function drawSpecies() {
  const species = statistics.groups.species, names = species.map((s) => plain(s.name)), families = species.map((s) => s.family);
  const bars = (key, colour, name) => ({
    type: "bar", name, x: names, y: species.map((s) => s[key]), marker: { color: rgbaOf(families, colour) },
    text: families, hovertemplate: "%{x} (%{text}): %{y} " + name + "<extra></extra>", textposition: "none", showlegend: false,
  });
  const legend = [...new Set(families)].map((family) => ({
    type: "scatter", mode: "markers", x: [null], y: [null], name: family, marker: { color: FAMILY_COLOURS[family], size: 10, symbol: "square" },
  }));
  draw("chart-species", [bars("candidates", pale, "candidates"), bars("kept", (c) => c, "labels"), ...legend],
    { barmode: "overlay", xaxis: { tickangle: -55, type: "category" }, yaxis: { title: { text: "candidates and labels" } } });
  const known = species.filter((s) => s.yield), at = known.map((s) => s.yield.share);
  draw("chart-yield", [{
    type: "scatter", mode: "markers", x: known.map((s) => plain(s.name)), y: at.map((y) => 100 * y),
    error_y: { type: "data", symmetric: false, array: known.map((s) => 100 * (s.yield.high - s.yield.share)), arrayminus: known.map((s) => 100 * (s.yield.share - s.yield.low)), color: "#9aa2ad", thickness: 1.5 },
    marker: { size: 9, color: rgbaOf(known.map((s) => s.family), (c) => c) },
    text: known.map((s) => `${s.kept} of ${s.candidates}`), hovertemplate: "%{x}: %{y:.1f} %, %{text}<extra></extra>",
  }], { xaxis: { tickangle: -55, type: "category" }, yaxis: { title: { text: "yield, %" }, range: [0, 100] }, shapes: [overallYield()], title: { text: "yield by species; dashed: all", font: { size: 14 } } });
}

function overallYield() {
  const counts = statistics.counts, share = 100 * (counts.retained + counts.refined) / Math.max(1, counts.candidates);
  return { type: "line", xref: "paper", x0: 0, x1: 1, y0: share, y1: share, line: { dash: "dash", color: INK, width: 1 } };
}

function drawErrors() {
  const errors = statistics.errors;
  if (!errors) return nothing("chart-errors", "No prediction was judged: the labels are those of the annotation files.");
  const bins = errors.final_counts.length, width = (errors.high - errors.low) / bins;
  const middles = errors.final_counts.map((_, i) => errors.low + (i + 0.5) * width);
  const traces = ["retained", "refined", "discarded"].map((verdict) => ({
    type: "bar", name: verdict, x: middles, y: errors.counts[verdict], width, marker: { color: VERDICT_COLOURS[verdict] },
    hovertemplate: "%{y} " + verdict + " at L_proj %{x:.4f}<extra></extra>",
  }));
  traces.push({ type: "scatter", mode: "lines", name: "labels, after", x: middles, y: errors.final_counts, line: { shape: "hvh", color: INK, width: 1.5 }, hovertemplate: "%{y} labels at %{x:.4f}<extra></extra>" });
  const shapes = [], annotations = [];
  Object.entries(statistics.thresholds || {}).forEach(([name, t], row) => {
    for (const [key, value] of [["tau_low", t.tau_low], ["tau_high", t.tau_high]]) {
      shapes.push({ type: "line", yref: "paper", x0: value, x1: value, y0: 0, y1: 1, line: { dash: "dot", color: INK, width: 1.5 } });
      const many = Object.keys(statistics.thresholds).length > 1;
      annotations.push({ x: value, yref: "paper", y: 0.98 - 0.07 * row, text: many ? `${key} (${plain(name)})` : key, showarrow: false, xanchor: "left", bgcolor: "rgba(255,255,255,.7)" });
    }
  });
  draw("chart-errors", traces, { barmode: "stack", bargap: 0, shapes, annotations, xaxis: { title: { text: `L_proj (${whole(errors.beyond)} of ${whole(errors.judged)} lie beyond)` } }, yaxis: { title: { text: "candidates" } } });
}

function drawAdaptation() {
  const a = statistics.adaptation;
  if (!a) return byId("adaptation").setAttribute("hidden", "");
  const split = (kept) => a.kept.map((k, i) => (k === kept ? i : -1)).filter((i) => i >= 0);
  const points = (kept, x, y, hover) => {
    const at = split(kept), verdict = kept ? "refined" : "discarded";
    return { type: "scatter", mode: "markers", name: verdict, x: at.map((i) => x[i]), y: at.map((i) => y[i]), marker: { size: 5, opacity: 0.6, color: VERDICT_COLOURS[verdict] }, hovertemplate: hover };
  };
  const gain = a.gain.map((g) => (g === null ? null : 100 * g));
  const deltas = [...new Set(Object.values(statistics.thresholds || {}).map((t) => 100 * t.delta))];
  const shown = a.shown < a.adapted ? `${whole(a.shown)} of ${whole(a.adapted)} shown` : `${whole(a.adapted)} adapted`;
  draw("chart-gain", [points(1, a.iterations, gain, "%{x} iterations, gain %{y:.1f} %"), points(0, a.iterations, gain, "%{x} iterations, gain %{y:.1f} %")], {
    xaxis: { title: { text: `iterations (${shown})` } }, yaxis: { title: { text: "gain in the first 10, %" } },
    shapes: deltas.map((d) => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: d, y1: d, line: { dash: "dot", color: INK } })),
  });
  const top = Math.max(...a.before);
  draw("chart-before-after", [points(1, a.before, a.after, "%{x} -> %{y}"), points(0, a.before, a.after, "%{x} -> %{y}")], {
    xaxis: { title: { text: "L_proj before" } }, yaxis: { title: { text: "L_proj after" } },
    shapes: [{ type: "line", x0: 0, y0: 0, x1: top, y1: top, line: { color: "#9aa2ad", width: 1 } }],
  });
}
