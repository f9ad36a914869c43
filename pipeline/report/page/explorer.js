// The threshold explorer: the fidelity rule once more, on the numbers that the build left of each candidate.
//
// What is known for sure of a candidate under other thresholds:
//   L_proj below tau_low        kept as predicted; with tta.refine_retained, as adapted in this build
//   L_proj from tau_high on     discarded
//   between, adapted before     its gain in the first iterations does not depend on the thresholds, so neither does
//                               its verdict; its label is the same if the best iterate lies within the new number of
//                               iterations and that number is no larger than the one it was given
//   between, never adapted      nothing
// With guards on, an outcome is known only where the candidate's band, iterations and delta stay as they were.

const KEPT = "kept", OUT = "out", UNKNOWN = "unknown";

function iterationsFor(error, t, rule) {
  const share = t.tau_high > t.tau_low ? (error - t.tau_low) / (t.tau_high - t.tau_low) : 0;
  return Math.floor(rule.iterations_min + (rule.iterations_max - rule.iterations_min) * share + 0.5);
}

function bandOf(error, t) {
  if (error < t.tau_low) return "low";
  return error >= t.tau_high ? "high" : "middle";
}

// {outcome, label}: label is "prediction", "built" (the one of this build) or null where it is not known.
function outcomeOf(e, i, t, built) {
  if (e.fixed[i]) return { outcome: OUT, label: null };
  const hasLabel = e.kept[i] || (e.trust && e.trust[i] !== null);
  const error = e.error[i], band = bandOf(error, t), before = bandOf(error, built);
  if (e.rule.guarded) {
    const same = band === before && (band !== "middle" || (t.delta === built.delta && iterationsFor(error, t, e.rule) === iterationsFor(error, built, e.rule)));
    if (band === "high") return { outcome: OUT, label: null };
    if (!same) return { outcome: UNKNOWN, label: null };
    return hasLabel ? { outcome: KEPT, label: "built" } : { outcome: OUT, label: null };
  }
  if (band === "low") {
    if (before === "low") return { outcome: KEPT, label: hasLabel ? "built" : "prediction" };
    return { outcome: KEPT, label: e.rule.refine_retained ? null : "prediction" };
  }
  if (band === "high") return { outcome: OUT, label: null };
  const taken = e.iterations[i];
  if (taken === 0 || e.gain[i] === null) return { outcome: UNKNOWN, label: null };
  const wanted = iterationsFor(error, t, e.rule), stopped = taken < iterationsFor(error, built, e.rule);
  if (e.gain[i] < t.delta) {
    const enough = stopped || taken >= Math.min(e.rule.gain_window, wanted);
    return { outcome: enough ? OUT : UNKNOWN, label: null };
  }
  const sameLabel = before === "middle" && hasLabel && wanted >= e.best_iteration[i] && (wanted <= taken || stopped);
  return { outcome: KEPT, label: sameLabel ? "built" : null };
}

// Counts under thresholds by dataset: {kept: [low, high], retained, unknown, auc: {sum, known, unknown}, species: [[low,
// high], ...]}. `retained` are those of the kept that lie below tau_low.
function explore(e, thresholds, minTrust) {
  const result = { kept: [0, 0], retained: 0, unknown: 0, auc: { sum: 0, known: 0, unknown: 0 }, species: e.species.map(() => [0, 0]) };
  for (let i = 0; i < e.error.length; ++i) {
    const name = e.datasets[e.dataset[i]], built = e.thresholds[name];
    let { outcome, label } = outcomeOf(e, i, thresholds[name], built);
    if (outcome !== OUT && minTrust > 0 && e.trust) {
      if (label !== "built" || e.trust[i] === null) outcome = UNKNOWN;
      else if (e.trust[i] < minTrust) outcome = OUT;
    }
    if (outcome === OUT) continue;
    if (outcome === UNKNOWN) {
      ++result.unknown;
      ++result.kept[1];
      ++result.species[e.group[i]][1];
      continue;
    }
    ++result.kept[0];
    ++result.kept[1];
    ++result.species[e.group[i]][0];
    ++result.species[e.group[i]][1];
    if (bandOf(e.error[i], thresholds[name]) === "low") ++result.retained;
    const auc = label === "prediction" ? e.auc_before[i] : label === "built" ? e.auc_after[i] ?? null : null;
    if (auc === null) ++result.auc.unknown;
    else {
      result.auc.sum += auc;
      ++result.auc.known;
    }
  }
  return result;
}

const range = ([low, high], show) => (show(low) === show(high) ? show(low) : `${show(low)} to ${show(high)}`);

// Thresholds in the address, as in report.html#tau_low=0.03&tau_high=0.06: a link to what one sees.
function fromAddress(current) {
  const wanted = new URLSearchParams(location.hash.slice(1)), result = { ...current };
  for (const key of ["tau_low", "tau_high", "delta", "min_trust"]) {
    const value = Number(wanted.get(key));
    if (wanted.has(key) && Number.isFinite(value)) result[key] = value;
  }
  return result;
}

function setUpExplorer() {
  const e = statistics.explorer;
  if (!e) return;
  const names = Object.keys(e.thresholds).filter((name) => e.datasets.includes(name));
  const chosen = Object.fromEntries(names.map((name) => [name, { ...e.thresholds[name] }]));
  const same = names.every((name) => ["tau_low", "tau_high", "delta"].every((key) => e.thresholds[name][key] === e.thresholds[names[0]][key]));
  const state = { scope: same ? "" : names[0], minTrust: e.rule.min_trust };
  const scopeNames = () => (state.scope === "" ? names : [state.scope]);
  const sorted = [...e.error].sort((a, b) => a - b);
  const top = Math.max(sorted[Math.floor(0.98 * (sorted.length - 1))], ...names.map((name) => 1.2 * e.thresholds[name].tau_high));
  const controls = byId("explorer-controls"), inputs = {};

  const addControl = (key, text, low, high, step) => {
    const label = element("label", text + " "), number = element("input"), slider = element("input");
    number.type = "number";
    slider.type = "range";
    number.step = "any";
    Object.assign(slider, { min: low, max: high, step });
    Object.assign(number, { min: low, id: "explore-" + key });
    slider.setAttribute("aria-label", text);
    label.append(number, slider);
    controls.append(label);
    inputs[key] = { number, slider };
    slider.addEventListener("input", () => set(key, Number(slider.value)));
    number.addEventListener("input", () => number.value !== "" && set(key, Number(number.value)));
  };
  const set = (key, value) => {
    if (key === "min_trust") state.minTrust = value;
    else for (const name of scopeNames()) chosen[name][key] = value;
    // tau_high never lies below tau_low.
    for (const name of scopeNames()) {
      if (key === "tau_low") chosen[name].tau_high = Math.max(chosen[name].tau_high, value);
      if (key === "tau_high") chosen[name].tau_low = Math.min(chosen[name].tau_low, value);
    }
    show();
  };

  if (names.length > 1) {
    const label = element("label", "thresholds of "), select = element("select");
    if (same) select.append(new Option("all datasets", ""));
    for (const name of names) select.append(new Option(name, name));
    select.addEventListener("change", () => { state.scope = select.value; show(); });
    label.append(select);
    controls.append(label);
  }
  addControl("tau_low", "tau_low", 0, top, top / 2000);
  addControl("tau_high", "tau_high", 0, top, top / 2000);
  addControl("delta", "delta", 0, 0.5, 0.005);
  if (e.trust) addControl("min_trust", "min_trust", 0, 1, 0.01);
  const reset = element("button", "as built");
  reset.type = "button";
  reset.addEventListener("click", () => {
    for (const name of names) Object.assign(chosen[name], e.thresholds[name]);
    state.minTrust = e.rule.min_trust;
    show();
  });
  controls.append(reset);

  let plotted = false;
  const show = () => {
    const current = chosen[scopeNames()[0]];
    for (const [key, { number, slider }] of Object.entries(inputs)) {
      const value = key === "min_trust" ? state.minTrust : current[key];
      slider.value = value;
      if (Number(number.value) !== value || number.value === "") number.value = value;
    }
    const result = explore(e, chosen, state.minTrust);
    showNumbers(e, result);
    byId("explorer-config").textContent = configText(names, chosen, state, e);
    plotted = plotSpecies(e, result, plotted);
  };
  const start = () => {
    const wanted = fromAddress({ ...chosen[scopeNames()[0]], min_trust: e.rule.min_trust });
    for (const name of scopeNames()) Object.assign(chosen[name], { tau_low: wanted.tau_low, tau_high: Math.max(wanted.tau_low, wanted.tau_high), delta: wanted.delta });
    state.minTrust = wanted.min_trust;
    show();
  };
  window.addEventListener("hashchange", start);
  start();
}

function showNumbers(e, result) {
  const others = Object.values(e.others), othersKept = others.reduce((sum, [, kept]) => sum + kept, 0);
  const total = e.error.length + others.reduce((sum, [candidates]) => sum + candidates, 0);
  const kept = result.kept.map((count) => count + othersKept), tiles = byId("explorer-numbers");
  tiles.replaceChildren();
  const named = (id, ...rest) => { tile(tiles, ...rest).firstChild.id = id; };
  named("explored-kept", range(kept, whole), "labels in the dataset", "#009e73");
  named("explored-yield", range(kept.map((k) => k / total), percent), "yield", "#009e73");
  named("explored-retained", whole(result.retained), "below tau_low", VERDICT_COLOURS.retained);
  named("explored-refined", range(result.kept.map((k) => k - result.retained), whole), "adapted and kept", VERDICT_COLOURS.refined);
  const auc = result.auc.known ? (result.auc.sum / result.auc.known).toFixed(1) : "-";
  named("explored-auc", auc, result.auc.unknown ? `AUC of the ${whole(result.auc.known)} labels that are known` : "AUC of the labels", INK);
  const parts = [];
  if (result.unknown) parts.push(`${whole(result.unknown)} candidates have no known outcome under these thresholds`);
  if (result.auc.unknown) parts.push(`${whole(result.auc.unknown)} labels would be adapted anew`);
  byId("explorer-state").textContent = parts.length ? `Needs a build: ${parts.join("; ")}.` : "Exact: every outcome is known from this build.";
}

function plotSpecies(e, result, plotted) {
  const built = statistics.groups.species.map((s) => s.name), index = new Map(e.species.map((name, i) => [name, i]));
  const extra = (name) => (e.others[name] ? e.others[name][1] : 0);
  const counts = built.map((name) => (index.has(name) ? result.species[index.get(name)] : [0, 0]).map((c) => c + extra(name)));
  const sums = [0, 1].map((side) => Math.max(1, counts.reduce((sum, c) => sum + c[side], 0)));
  // With a range, the share of one species is least where it loses all that are open and the others none.
  const least = counts.map((c) => 100 * c[0] / Math.max(1, sums[1] - c[1] + c[0])), most = counts.map((c) => 100 * c[1] / Math.max(1, sums[0] - c[0] + c[1]));
  const middle = least.map((l, i) => (l + most[i]) / 2), names = built.map(plain);
  const now = { type: "bar", name: "explored", x: names, y: middle, error_y: { type: "data", array: most.map((m, i) => m - middle[i]), visible: result.unknown > 0 }, marker: { color: rgbaOf(statistics.groups.species.map((s) => s.family), (c) => c) }, hovertemplate: "%{x}: %{y:.1f} %<extra></extra>" };
  const was = { type: "scatter", mode: "markers", name: "as built", x: names, y: statistics.groups.species.map((s) => 100 * s.share_after), marker: { symbol: "line-ew-open", size: 14, color: INK, line: { width: 2 } }, hovertemplate: "%{x}: %{y:.1f} % as built<extra></extra>" };
  const layout = { xaxis: { tickangle: -55, type: "category" }, yaxis: { title: { text: "share of the labels, %" }, rangemode: "tozero" }, title: { text: "species: explored (bars) and as built (lines)", font: { size: 14 } }, showlegend: false };
  if (plotted) Plotly.restyle("chart-explorer", { y: [middle, was.y], "error_y.array": [now.error_y.array, null], "error_y.visible": [result.unknown > 0, null] });
  else draw("chart-explorer", [now, was], layout);
  return true;
}

function configText(names, chosen, state, e) {
  const short = (value) => Number(value.toPrecision(8));
  const parts = (t) => ({ tau_low: short(t.tau_low), tau_high: short(t.tau_high), delta: short(t.delta) });
  const first = chosen[names[0]];
  const same = names.every((name) => ["tau_low", "tau_high", "delta"].every((key) => chosen[name][key] === first[key]));
  const filter = same ? parts(first) : { ...parts(first), datasets: Object.fromEntries(names.map((name) => [name, parts(chosen[name])])) };
  if (e.trust && state.minTrust > 0) filter.min_trust = short(state.minTrust);
  return JSON.stringify({ filter }, null, 2);
}
