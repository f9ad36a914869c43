// The second half of the charts, the galleries and the provenance.

function drawAccuracy() {
  const a = statistics.accuracy, traces = [];
  const add = (curve, name, colour, dash) => {
    if (!curve) return;
    traces.push({ type: "scatter", mode: "lines", name: `${name}: AUC ${curve.auc.toFixed(1)} (${whole(curve.samples)})`, x: a.thresholds, y: curve.pck, line: { color: colour, dash, width: 2.5 }, hovertemplate: "%{y:.1f} % within %{x}<extra></extra>" });
  };
  add(a.predictions, "all predictions", "#9aa2ad", "solid");
  add(a.labels_before, "kept, as predicted", "#0072b2", "dash");
  add(a.labels, "labels", "#e69f00", "solid");
  if (traces.length === 0) nothing("chart-pck", "No body of this dataset has a projection.");
  else draw("chart-pck", traces, { xaxis: { title: { text: "threshold (crop side = 1)" } }, yaxis: { title: { text: "PCK, %" }, range: [0, 100] }, legend: { orientation: "v", x: 1, xanchor: "right", y: 0, yanchor: "bottom" } });
  const points = statistics.keypoints.filter((k) => k.kept > 0).reverse();
  if (points.length === 0) return nothing("chart-keypoints", "No label has a visible keypoint.");
  const names = points.map((k) => k.name);
  const hover = points.map((k) => `${k.name}: visible in ${whole(k.kept)} labels`);
  const dots = (key, name, colour) => ({ type: "scatter", mode: "markers", name, y: names, x: points.map((k) => k[key]), text: hover, hovertemplate: "%{text}, %{x:.4f}<extra></extra>", marker: { color: colour, size: 9 } });
  draw("chart-keypoints", [dots("error_before", "as predicted", "#0072b2"), dots("error_after", "labels", "#e69f00")],
    { margin: { l: 140, r: 16, t: 36, b: 50 }, xaxis: { title: { text: "mean distance (crop side = 1)" }, rangemode: "tozero" } });
}

function drawVisible() {
  const v = statistics.visible, counts = v.candidates.map((_, i) => i);
  const bars = (y, name, colour) => ({ type: "bar", name, x: counts, y, marker: { color: colour }, hovertemplate: "%{y} " + name + " with %{x}<extra></extra>" });
  draw("chart-visible", [bars(v.candidates, "candidates", pale("#0072b2")), bars(v.kept, "labels", "#0072b2")],
    { barmode: "overlay", xaxis: { title: { text: "visible keypoints of 26" } }, yaxis: { title: { text: "candidates and labels" } } });
  const boxes = statistics.sizes.box_side_histogram;
  if (boxes) {
    const width = (boxes.high - boxes.low) / boxes.counts.length;
    draw("chart-boxes", [{ type: "bar", x: boxes.counts.map((_, i) => boxes.low + (i + 0.5) * width), y: boxes.counts, width, marker: { color: "#0072b2" }, hovertemplate: "%{y} at %{x:.0f} px<extra></extra>" }],
      { bargap: 0, xaxis: { title: { text: "longer side of the box, px" } }, yaxis: { title: { text: "candidates" } }, shapes: [{ type: "line", yref: "paper", x0: 256, x1: 256, y0: 0, y1: 1, line: { dash: "dot", color: INK } }] });
  } else nothing("chart-boxes", "No box is known.");
  const rows = [["picture width, px", "picture_width_px"], ["picture height, px", "picture_height_px"], ["box, longer side, px", "box_side_px"]];
  const order = ["min", "q05", "q25", "median", "q75", "q95", "max"];
  const shown = (value) => (value === null || value === undefined ? "-" : String(Math.round(value)));
  fillTable(byId("table-sizes"), ["", "least", "5 %", "25 %", "median", "75 %", "95 %", "most"], rows.map(([name, key]) => [name, ...order.map((q) => shown(statistics.sizes[key][q]))]));
}

function drawShape() {
  const s = statistics.shape;
  if (!s) {
    nothing("chart-pca", "Fewer than three labels have a shape.");
    return byId("chart-tsne").remove();
  }
  byId("ari").textContent = s.ari ? `ARI ${s.ari.value} over ${whole(s.ari.labels)} labels of known family (k-means with ${s.ari.clusters} groups, seed ${s.ari.seed}).` : "ARI: fewer than two families are known.";
  const scatter = (id, space, x, y, xText, yText) => {
    const families = [...new Set(space.family)];
    draw(id, families.map((family) => {
      const at = space.family.map((f, i) => (f === family ? i : -1)).filter((i) => i >= 0);
      return { type: "scatter", mode: "markers", name: family, x: at.map((i) => x[i]), y: at.map((i) => y[i]), text: at.map((i) => plain(`${space.species[i] || "unknown"}, ${space.id[i]}`)), hovertemplate: "%{text}<extra></extra>", marker: { size: 5, opacity: 0.65, color: FAMILY_COLOURS[family] } };
    }), { xaxis: { title: { text: xText } }, yaxis: { title: { text: yText } } });
  };
  const part = (i) => `component ${i + 1} (${percent(s.explained[i])} of the variance)`;
  scatter("chart-pca", s, s.x, s.y, part(0), part(1) + (s.shown < s.labels ? `, ${whole(s.shown)} of ${whole(s.labels)} shown` : ""));
  const t = statistics.tsne;
  if (t) scatter("chart-tsne", t, t.x, t.y, `t-SNE (perplexity ${t.perplexity}, seed ${t.seed})`, "");
  else nothing("chart-tsne", "t-SNE: not computed. tools/shape_tsne.py makes it (it needs scikit-learn); then run report again.");
}

function drawTrust() {
  const t = statistics.trust;
  if (!t) return byId("trust").setAttribute("hidden", "");
  const width = (t.high - t.low) / t.counts.length;
  draw("chart-trust", [{ type: "bar", x: t.counts.map((_, i) => t.low + (i + 0.5) * width), y: t.counts, width, marker: { color: "#0072b2" } }],
    { bargap: 0, xaxis: { title: { text: "trust" }, range: [t.low, t.high] }, yaxis: { title: { text: "labels" } } });
}

function drawGalleries() {
  for (const gallery of pictures) {
    const box = element("details"), head = element("summary");
    box.open = gallery.open;
    head.append(element("b", gallery.title), element("span", ` (${gallery.cards.length}): ${gallery.meaning}`));
    const cards = element("div", undefined, "cards");
    for (const card of gallery.cards) cards.append(cardOf(card, gallery.panels));
    box.append(head, cards);
    byId("gallery-list").append(box);
  }
}

function cardOf(card, panels) {
  const figure = element("figure"), caption = element("figcaption"), titles = element("div", undefined, "titles");
  for (const panel of panels) titles.append(element("span", panel));
  const image = element("img");
  image.loading = "lazy";
  image.decoding = "async";
  image.alt = `${card.id}: ${panels.join(", ")}`;
  image.width = card.width;
  image.height = card.height;
  image.src = card.picture;
  titles.style.width = card.width + "px";
  caption.append(element("div", card.id, "id"), element("div", card.line));
  const story = element("details");
  story.append(element("summary", card.why || "all that is known"), element("pre", card.story));
  caption.append(story);
  figure.append(titles, image, caption);
  return figure;
}

function drawProvenance() {
  const p = statistics.provenance;
  for (const line of statistics.notes) byId("notes").append(element("li", textOf(line)));
  const rows = [["dataset key", statistics.dataset.key], ["content id", statistics.dataset.content_id]];
  const flatten = (prefix, value) => {
    if (value === null) return;
    if (typeof value !== "object") rows.push([prefix, String(value)]);
    else for (const [key, inner] of Object.entries(value)) flatten(`${prefix} ${key}`, inner);
  };
  for (const [key, value] of Object.entries(p)) if (key !== "config") flatten(key.replaceAll("_", " "), value);
  for (const [name, value] of rows) {
    const row = element("tr");
    row.append(element("td", name), element("td", value, "digest"));
    byId("table-provenance").append(row);
  }
  byId("config").textContent = JSON.stringify(p.config, null, 2);
  byId("footer").textContent = "All numbers are in statistics.json. docs/report.md explains how to read each part.";
}

// One part after the other, so that the first ones are seen at once. `drawn` is what tests wait for.
function drawAll() {
  const parts = [drawHead, drawFunnel, drawDatasets, drawGalleries, drawFamilies, drawSpecies, drawErrors, drawAdaptation, setUpExplorer, drawAccuracy, drawVisible, drawShape, drawTrust, drawProvenance];
  if (!statistics.trust) byId("trust").hidden = true;
  if (!statistics.adaptation) byId("adaptation").hidden = true;
  if (!statistics.explorer) byId("explorer").hidden = true;
  const next = () => {
    const part = parts.shift();
    if (part) {
      part();
      setTimeout(next, 0);
    } else document.body.dataset.drawn = String(Math.round(performance.now()));
  };
  next();
}

drawAll();
