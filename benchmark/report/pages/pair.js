/* The page of a pair: two surfaces that turn together, coloured by match, truth or error; runs, traces, functional maps. */
"use strict";
(() => {
  const NR = (window.NONRIGID = window.NONRIGID || {});
  const GREY = [176, 180, 186];
  const MATCH = [213, 94, 0];
  const TRUTH = [0, 158, 115];
  const MIRROR = [86, 180, 233];
  const PICKED = [240, 228, 66];
  const WORST = 0.25;
  const UNKNOWN = 65535;  // in place of an error: the vertex has no ground truth
  // Cividis, which every colour vision orders alike.
  const SCALE = [[0, 34, 78], [18, 53, 112], [59, 73, 108], [87, 93, 109], [112, 113, 115], [138, 134, 120], [165, 156, 116],
    [195, 179, 105], [225, 204, 85], [254, 232, 56]];
  const shade = (share) => {
    const at = Math.min(Math.max(share, 0), 1) * (SCALE.length - 1);
    const low = Math.min(Math.floor(at), SCALE.length - 2);
    return SCALE[low].map((value, k) => Math.round(value + (at - low) * (SCALE[low + 1][k] - value)));
  };
  const $ = (id) => document.getElementById(id);
  const element = (tag, text, parent) => {
    const made = document.createElement(tag);
    if (text !== undefined && text !== null) made.textContent = text;
    if (parent) parent.append(made);
    return made;
  };

  /* Points of the full surface, one for each listed vertex of the part: triangle, two weights, error in 1/10000. */
  const readPoints = (block, count) => {
    if (!block) return null;
    const rows = block.rows ? NR.decode(block.rows, block.wide ? Uint32Array : Uint16Array) : null;
    const faces = NR.decode(block.faces, block.wide ? Uint32Array : Uint16Array);
    const weights = NR.decode(block.weights, Uint8Array);
    const errors = block.errors ? NR.decode(block.errors, Uint16Array) : null;
    const of = new Int32Array(count).fill(-1);
    for (let i = 0; i < faces.length; i++) of[rows ? rows[i] : i] = i;
    return { of, faces, weights, errors, count: faces.length };
  };

  class Pair {
    constructor(data, full, turn) {
      this.data = data;
      this.part = NR.readSurface(data.part);
      this.full = NR.readSurface(full);
      this.places = NR.decode(full.colours, Uint8Array);
      this.count = this.part.positions.length / 3;
      this.truth = readPoints(data.truth, this.count);
      this.mirrored = readPoints(data.mirrored, this.count);
      this.cameras = [new NR.Camera(turn), new NR.Camera(turn)];
      const [small, large] = [this.part, this.full].map((surface) => 0.86 * Math.hypot(...surface.size) / 2);
      // A small part is shown larger, but not so much that one forgets how small it is.
      const radii = [Math.max(small, large / 1.8), large];
      this.views = ["part", "full"].map((role, k) => new NR.SurfaceView($(role), this[role], this.cameras[k], radii[k]));
      this.views[0].onpick = (vertex) => this.pick(vertex);
      this.link(true);
      this.mode = "match";
      this.picked = -1;
    }

    /* Let the surfaces turn together, from where the part is seen. */
    link(together) {
      this.linked = together;
      const [a, b] = this.cameras;
      if (!this.joined) {
        this.joined = true;
        for (const [mine, other] of [[a, b], [b, a]]) {
          mine.watchers.push(() => {
            if (!this.linked || this.copying) return;
            this.copying = true;
            Object.assign(other, { turn: mine.turn.slice(), zoom: mine.zoom, shift: mine.shift.slice() });
            other.changed();
            this.copying = false;
          });
        }
      }
      if (together) a.changed();
    }

    show(points, mode) {
      Object.assign(this, { points, mode });
      const { truth, places } = this;
      const shown = mode === "truth" ? truth : points;
      const sparse = shown && shown.count < this.count / 2;
      const colour = (i) => {
        if (mode !== "error") return this.mixed(shown, i, places);
        return shown.errors[i] === UNKNOWN ? GREY : shade(shown.errors[i] / 1e4 / WORST);
      };
      const [part, full] = [new Uint8Array(3 * this.count), new Uint8Array(this.full.positions.length)];
      for (const colours of [part, full]) for (let i = 0; i < colours.length; i++) colours[i] = GREY[i % 3];
      const dots = [[], []];
      const told = shown && (mode !== "error" || shown.errors);
      // Few matches are dots; their colours are then told on the whole of the full surface.
      if (sparse && mode !== "error") full.set(places);
      if (told) {
        const hits = new Float32Array(full.length / 3);
        const sums = new Float32Array(full.length);
        for (let vertex = 0; vertex < this.count; vertex++) {
          const i = shown.of[vertex];
          if (i < 0) continue;
          const tint = colour(i);
          if (sparse) {
            dots[0].push({ at: this.corner(this.part, vertex), colour: tint, size: 9, shape: 0 });
            dots[1].push({ at: this.position(shown, i), colour: tint, size: 9, shape: 0 });
            continue;
          }
          part.set(tint, 3 * vertex);
          for (let k = 0; k < 3; k++) {
            const corner = this.full.faces[3 * shown.faces[i] + k];
            hits[corner]++;
            for (let c = 0; c < 3; c++) sums[3 * corner + c] += tint[c];
          }
        }
        for (let corner = 0; corner < hits.length; corner++) {
          if (!hits[corner]) continue;
          for (let c = 0; c < 3; c++)
            full[3 * corner + c] = mode === "error" ? sums[3 * corner + c] / hits[corner] : places[3 * corner + c];
        }
      }
      this.views[0].colour(part);
      this.views[1].colour(full);
      this.views.forEach((view, k) => view.points("dots", dots[k]));
      this.mark();
    }

    mixed(points, i, places) {
      const [u, v] = [points.weights[2 * i] / 255, points.weights[2 * i + 1] / 255];
      const corners = [0, 1, 2].map((k) => 3 * this.full.faces[3 * points.faces[i] + k]);
      return [0, 1, 2].map((c) => u * places[corners[0] + c] + v * places[corners[1] + c] + (1 - u - v) * places[corners[2] + c]);
    }
    position(points, i) {
      return this.mixed(points, i, this.full.positions);
    }
    corner(surface, vertex) {
      return Array.from(surface.positions.subarray(3 * vertex, 3 * vertex + 3));
    }

    /* Where few vertices have a match, take the nearest that has one. */
    pick(vertex, exactly = false) {
      if (vertex < 0) return;
      const { points } = this;
      if (!exactly && points && points.count < this.count / 2 && points.of[vertex] < 0) {
        const here = this.corner(this.part, vertex);
        let least = Infinity;
        for (let other = 0; other < this.count; other++) {
          if (points.of[other] < 0) continue;
          const far = Math.hypot(...this.corner(this.part, other).map((value, k) => value - here[k]));
          if (far < least) [least, vertex] = [far, other];
        }
      }
      this.picked = vertex;
      $("vertex").value = vertex;
      this.mark();
    }

    mark() {
      const { picked: vertex, points, truth, mirrored } = this;
      if (vertex < 0) return;
      const mark = (at, colour, shape, size) => ({ at, colour, shape, size });
      this.views[0].points("marks", [mark(this.corner(this.part, vertex), PICKED, 0, 17)]);
      const marks = [];
      const words = [`Vertex ${vertex}`];
      const i = points ? points.of[vertex] : -1;
      const known = i >= 0 && points.errors && points.errors[i] !== UNKNOWN;
      for (const [side, colour, shape] of [[truth, TRUTH, 1], [mirrored, MIRROR, 2]]) {
        if (side && side.of[vertex] >= 0) marks.push(mark(this.position(side, side.of[vertex]), colour, shape, 20));
      }
      if (i >= 0) {
        marks.push(mark(this.position(points, i), MATCH, 0, 17));
        words.push(`match in triangle ${points.faces[i]}`);
        if (truth && truth.of[vertex] >= 0) words.push(`truth in triangle ${truth.faces[truth.of[vertex]]}`);
        if (known) words.push(`geodesic error ${NR.cell(points.errors[i] / 100)} x100, to the ${this.side} map`);
      } else words.push("no match in this run");
      this.views[1].points("marks", marks);
      this.answer = { vertex, matched: i >= 0, error: known ? points.errors[i] / 1e4 : null, marks: marks.length };
      $("readout").textContent = words.join("; ") + ".";
    }
  }

  const details = (run) => {
    const root = $("details");
    root.replaceChildren();
    element("h3", `${run.label}, ${run.backend}: ${run.status}`, root);
    element("p", run.message, root).className = "note";
    if (run.log) {
      const link = element("a", "Native log", element("p", null, root));
      link.href = run.log;
    }
    if (!run.stages.length) return;
    const scroll = element("div", null, root);
    scroll.className = "scroll";
    scroll.tabIndex = 0;
    const table = element("table", null, scroll);
    const head = table.createTHead().insertRow();
    const columns = ["problem", "variables", "solver", "route", "claim", "status", "message", "raw_status", "objective", "gap", "violation",
      "stationarity", "bound", "certificate", "evaluations", "build_seconds", "solve_seconds"];
    columns.forEach((name) => (element("th", name.replace("raw_status", "the solver's own words").replaceAll("_", " "), head).scope = "col"));
    const body = table.createTBody();
    run.stages.forEach((stage) => {
      const row = body.insertRow();
      columns.forEach((name) => {
        const value = stage[name];
        const cell = element("td", Array.isArray(value) ? value.join(" > ") : NR.cell(value), row);
        cell.className = ["message", "raw_status", "route"].includes(name) ? "words" : typeof value === "number" ? "number" : "";
      });
    });
  };

  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const layout = (more) => ({
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", margin: { l: 70, r: 20, t: 20, b: 50 },
    font: { family: "system-ui, sans-serif", size: 12, color: style("--ink") }, ...more,
  });
  const axis = (more) => ({ gridcolor: style("--line"), zerolinecolor: style("--line"), linecolor: style("--faint"), ...more });
  const PALETTE = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00"];

  /* Distance of the objective to the best known, along the work of every solver on one problem. */
  const traces = (runs) => {
    const problems = new Map();
    runs.forEach((run) => run.stages.forEach((stage, place) => {
      if (!stage.trace || !stage.trace.length) return;
      const key = `${run.label}: ${place + 1}. ${stage.problem}`;
      problems.set(key, [...(problems.get(key) || []), { run, stage }]);
    }));
    const [chosen, along] = [$("problem"), $("along")];
    chosen.replaceChildren(...[...problems.keys()].map((key) => new Option(key, key)));
    $("traces").hidden = !problems.size;
    const draw = () => {
      const members = problems.get(chosen.value) || [];
      const best = new Map();
      members.forEach(({ stage }) => {
        const found = [stage.objective, ...stage.trace.map((point) => point[2])].filter(Number.isFinite);
        const sign = stage.sense === "maximize" ? 1 : -1;
        const top = Math.max(...found.map((value) => sign * value), sign * (best.get(stage.problem_hash) ?? -sign * Infinity));
        best.set(stage.problem_hash, sign * top);
      });
      const lines = members.map(({ run, stage }, k) => {
        const top = best.get(stage.problem_hash);
        const points = [...stage.trace, [stage.solve_seconds, stage.evaluations, stage.objective, stage.violation]].filter((p) => Number.isFinite(p[2]));
        return {
          name: run.backend, mode: "lines+markers", marker: { size: 4, symbol: k % 8 },
          line: { color: PALETTE[k % PALETTE.length], dash: ["solid", "dash", "dot"][Math.floor(k / PALETTE.length) % 3] },
          x: points.map((p) => Math.max(p[along.value === "seconds" ? 0 : 1], along.value === "seconds" ? 1e-5 : 1)),
          y: points.map((p) => Math.max(Math.abs(p[2] - top) / Math.max(Math.abs(top), 1e-12), 1e-12)),
          customdata: points.map((p) => p[2]),
          hovertemplate: "objective %{customdata:.6g}<br>distance %{y:.2e}<br>at %{x:.3g}",
        };
      });
      Plotly.react($("trace"), lines, layout({
        xaxis: axis({ type: "log", title: { text: along.value === "seconds" ? "seconds" : "evaluations" } }),
        yaxis: axis({ type: "log", title: { text: "distance to the best objective" }, exponentformat: "power" }),
        legend: { orientation: "h", y: 1.12 },
      }), { responsive: true, displaylogo: false });
    };
    chosen.onchange = draw;
    along.onchange = draw;
    if (problems.size) draw();
  };

  const heatmap = (run) => {
    $("map-section").hidden = !run.map;
    if (!run.map) return;
    const values = NR.decode(run.map.values, Float32Array);
    const z = Array.from({ length: run.map.rows }, (_, i) => Array.from(values.subarray(i * run.map.columns, (i + 1) * run.map.columns)));
    const most = Math.max(...values.map(Math.abs));
    // White is zero on a light page as on a dark one; blue and orange keep the signs apart for every colour vision.
    Plotly.react($("map"), [{ type: "heatmap", z, zmin: -most, zmax: most, colorscale: [[0, "#0072B2"], [0.5, "#ffffff"], [1, "#D55E00"]] }],
      layout({ yaxis: axis({ autorange: "reversed", title: { text: "row" } }), xaxis: axis({ title: { text: "column" } }) }),
      { responsive: true, displaylogo: false });
  };

  document.addEventListener("DOMContentLoaded", () => {
    const data = NR.pair;
    const pair = data.part ? new Pair(data, NR.surfaces[data.full], NR.turns[data.full]) : null;
    const blocks = new Map();
    const pointsOf = (run) => {
      if (!pair || !run.points) return null;
      if (!blocks.has(run.points)) blocks.set(run.points, readPoints(data.points[run.points], pair.count));
      return blocks.get(run.points);
    };
    const modes = [...document.querySelectorAll("input[name=mode]")];
    const page = (NR.page = { pair, run: null });
    const paint = () => {
      if (!pair) return;
      const points = pointsOf(page.run);
      modes.find((input) => input.value === "error").disabled = !(points && points.errors);
      modes.find((input) => input.value === "truth").disabled = !pair.truth;
      if (modes.some((input) => input.checked && input.disabled)) modes[0].checked = true;
      pair.side = page.run.side || "direct";
      const mode = modes.find((input) => input.checked).value;
      $("bar").hidden = mode !== "error";
      pair.show(points, mode);
    };
    page.select = (id) => {
      page.run = data.runs.find((run) => run.id === id);
      document.querySelectorAll("tr[data-run]").forEach((row) => {
        row.setAttribute("aria-selected", row.dataset.run === id);
        row.querySelector("input").checked = row.dataset.run === id;
      });
      paint();
      if ($("details")) details(page.run);
      if (window.Plotly && $("map-section")) heatmap(page.run);
    };
    modes.forEach((input) => input.addEventListener("change", paint));
    document.querySelectorAll("tr[data-run] input").forEach((input) => input.addEventListener("change", () => page.select(input.value)));
    if (pair) {
      $("ramp").style.background = `linear-gradient(to right, ${SCALE.map((colour) => `rgb(${colour})`).join(",")})`;
      $("link").addEventListener("change", (event) => pair.link(event.target.checked));
      $("reset").addEventListener("click", () => pair.cameras.forEach((camera) => camera.reset()));
      $("vertex").max = pair.count - 1;
      $("vertex").addEventListener("change", (event) => {
        const vertex = Math.round(Number(event.target.value));
        if (vertex >= 0 && vertex < pair.count) pair.pick(vertex, true);
      });
      const step = (by) => {
        const points = pointsOf(page.run);
        if (!points || !points.count) return;
        let vertex = pair.picked;
        do vertex = (vertex + by + pair.count) % pair.count;
        while (points.of[vertex] < 0);
        pair.pick(vertex, true);
      };
      $("before").addEventListener("click", () => step(-1));
      $("after").addEventListener("click", () => step(1));
    }
    if (data.runs.length) {
      const first = data.runs.find((run) => run.points) || data.runs[0];
      page.select(first.id);
    }
    // The plotting library is large; it comes after the surfaces are shown.
    NR.plots = () => {
      traces(data.runs);
      if (page.run) heatmap(page.run);
    };
    if (window.Plotly) NR.plots();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => window.Plotly && NR.plots());
  });
})();
