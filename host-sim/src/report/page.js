"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = (id) => document.getElementById(id);
  document.body.classList.add("scripted");

  /* Theme: what the system says, until the button is pressed. */
  const root = document.documentElement;
  const darkSystem = matchMedia("(prefers-color-scheme: dark)");
  let chosenTheme = null;
  try { chosenTheme = localStorage.getItem("cdpr-theme"); } catch { /* not kept, then */ }
  const redraws = [];
  const resolved = new Map(); // colours by name, for the present theme
  function applyTheme() {
    const dark = chosenTheme ? chosenTheme === "dark" : darkSystem.matches;
    root.dataset.theme = dark ? "dark" : "light";
    resolved.clear();
    $("theme").textContent = dark ? "Light" : "Dark";
    $("theme").setAttribute("aria-label", dark ? "Change to light colours" : "Change to dark colours");
    for (const redraw of redraws) redraw();
  }
  $("theme").hidden = false;
  $("theme").addEventListener("click", () => {
    chosenTheme = root.dataset.theme === "dark" ? "light" : "dark";
    try { localStorage.setItem("cdpr-theme", chosenTheme); } catch { /* not kept, then */ }
    applyTheme();
  });
  darkSystem.addEventListener("change", applyTheme);
  /* Paper is light, and so are pictures on it. */
  addEventListener("beforeprint", () => {
    root.dataset.theme = "light";
    resolved.clear();
    for (const redraw of redraws) redraw();
  });
  addEventListener("afterprint", applyTheme);
  /** A colour of the style sheet, which the theme has decided, as the canvas wants it. */
  function color(name) {
    if (!resolved.has(name)) {
      const probe = document.body.appendChild(document.createElement("i"));
      probe.style.color = `var(--${name})`;
      resolved.set(name, getComputedStyle(probe).color);
      probe.remove();
    }
    return resolved.get(name);
  }
  const cableColor = (i) => color("c" + (i % 6 + 1));

  /** Makes the canvas as fine as the screen; its size in CSS px. */
  function prepare(canvas) {
    const { clientWidth: width, clientHeight: height } = canvas;
    const fine = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(width * fine));
    canvas.height = Math.max(1, Math.round(height * fine));
    const pen = canvas.getContext("2d");
    pen.setTransform(fine, 0, 0, fine, 0, 0);
    pen.clearRect(0, 0, width, height);
    return { pen, width, height };
  }

  function digits(value, count = 6) {
    if (value === 0) return "0";
    const size = Math.abs(value);
    if (size >= 1e7 || size < 1e-5) return value.toExponential(count - 1).replace("-", "\u2212");
    return String(Number(value.toPrecision(count))).replace("-", "\u2212");
  }

  /** Steps of a grid: 1, 2 or 5 times a power of ten, about `size`. */
  function roundStep(size) {
    const unit = 10 ** Math.floor(Math.log10(size));
    return [1, 2, 5, 10].find((k) => k * unit >= size * 0.999) * unit;
  }

  /* ---- The robot ---- */

  const add = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  const solid = [...data.anchors, ...data.attachments, data.position];
  const ground = Math.min(0, ...solid.map((p) => p[2]));

  function box(points) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const p of points) {
      for (let k = 0; k < 3; k++) {
        low[k] = Math.min(low[k], p[k]);
        high[k] = Math.max(high[k], p[k]);
      }
    }
    return { low, high };
  }

  /* The grid on the ground. */
  const extent = box(solid);
  const step = roundStep(Math.max(extent.high[0] - extent.low[0], extent.high[1] - extent.low[1], 1e-6) / 12);
  const from = [0, 1].map((k) => Math.floor(extent.low[k] / step - 0.5) * step);
  const cells = [0, 1].map((k) => Math.ceil((extent.high[k] + 0.5 * step - from[k]) / step));
  const till = [0, 1].map((k) => from[k] + cells[k] * step);
  /* What the usual view shows: cables may leave it. */
  const fixed = [...solid, ...[from[0], till[0]].flatMap((x) => [from[1], till[1]].map((y) => [x, y, ground]))];

  const triples = (flat) => Array.from({ length: flat.length / 3 }, (_, k) => flat.slice(3 * k, 3 * k + 3));
  const solutions = data.solutions.map((solution) =>
    solution.cables.map((cable) => ({ ...cable, points: triples(cable.points) })));

  const picture = $("picture");
  const FIELD = 0.4; // half the angle of view, rad
  const LEVEL = 0.42; // usual height of the eye, rad
  const view = { turn: 0, tilt: LEVEL, distance: 1, target: [0, 0, 0] };
  let chosen = solutions.length ? 0 : null; // index, "all", or null: no solution

  const shownSolutions = () =>
    chosen === "all" ? solutions.map((_, k) => k) : chosen === null ? [] : [chosen];

  function axes() {
    const [c, s] = [Math.cos(view.turn), Math.sin(view.turn)];
    const [ct, st] = [Math.cos(view.tilt), Math.sin(view.tilt)];
    const ahead = [s * ct, c * ct, -st];
    return { right: [c, -s, 0], ahead, up: [s * st, c * st, ct], eye: add(view.target, ahead, -view.distance) };
  }

  /** Looks at `points` from the present side so that they just fit. */
  function fit(points) {
    const { low, high } = box(points);
    view.target = low.map((l, k) => (l + high[k]) / 2);
    const { right, up, ahead } = axes();
    const aspect = picture.clientWidth / Math.max(1, picture.clientHeight);
    const [across, upright] = [Math.tan(FIELD) * Math.max(1, aspect), Math.tan(FIELD) * Math.max(1, 1 / aspect)];
    const room = 0.86;
    const size = Math.hypot(...low.map((l, k) => high[k] - l)) || 1;
    let distance = 2 * size;
    for (let pass = 0; pass < 8; pass++) {
      // Centre what is seen, then step to where the outermost point wants it.
      const seen = points.map((p) => {
        const d = add(p, view.target, -1);
        return [dot(d, right), dot(d, up), dot(d, ahead)];
      });
      const middle = (k) => {
        const places = seen.map((p) => p[k] / Math.max(1e-3 * size, p[2] + distance));
        return ((Math.min(...places) + Math.max(...places)) / 2) * distance;
      };
      const [x, y] = [middle(0), middle(1)];
      view.target = add(add(view.target, right, x), up, y);
      distance = Math.max(1e-3 * size, ...seen.map((p) =>
        Math.max(Math.abs(p[0] - x) / (across * room), Math.abs(p[1] - y) / (upright * room)) - p[2]));
    }
    view.distance = distance;
  }

  function reset() {
    // From the side on which the robot looks widest, a little to the corner.
    const { low, high } = extent;
    view.turn = high[0] - low[0] >= high[1] - low[1] ? -0.6 : 0.85;
    view.tilt = LEVEL;
    fit(fixed);
  }

  /** The smallest convex polygon around points of the picture. */
  function hull(points) {
    const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const half = (list) => list.reduce((path, p) => {
      while (path.length > 1) {
        const [a, b] = path.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        path.pop();
      }
      return [...path, p];
    }, []);
    return [...half(sorted).slice(0, -1), ...half(sorted.reverse()).slice(0, -1)];
  }

  function drawRobot() {
    const { pen, width, height } = prepare(picture);
    const { right, up, ahead, eye } = axes();
    const scale = Math.min(width, height) / 2 / Math.tan(FIELD);
    const near = view.distance * 1e-3;
    const see = (p) => {
      const d = add(p, eye, -1);
      return [dot(d, right), dot(d, up), dot(d, ahead)];
    };
    const place = ([x, y, z]) => [width / 2 + (scale * x) / z, height / 2 - (scale * y) / z];
    /* Lines in space, cut where they pass the eye. */
    const trace = (points) => {
      pen.beginPath();
      let before = null;
      for (const p of points) {
        const here = see(p);
        if (before) {
          let [a, b] = [before, here];
          if (a[2] > near || b[2] > near) {
            const cut = (inside, outside) => {
              const t = (inside[2] - near) / (inside[2] - outside[2]);
              return inside.map((c, k) => c + t * (outside[k] - c));
            };
            if (a[2] < near) a = cut(b, a);
            if (b[2] < near) b = cut(a, b);
            if (before[2] < near || !before.drawn) pen.moveTo(...place(a));
            pen.lineTo(...place(b));
            here.drawn = here[2] >= near;
          }
        }
        before = here;
      }
      pen.stroke();
    };

    /* The ground. */
    pen.lineWidth = 1;
    pen.strokeStyle = color("earth");
    for (let k = 0; k <= cells[0]; k++) trace([[from[0] + k * step, from[1], ground], [from[0] + k * step, till[1], ground]]);
    for (let k = 0; k <= cells[1]; k++) trace([[from[0], from[1] + k * step, ground], [till[0], from[1] + k * step, ground]]);

    /* Masts, and where the platform is above the ground. */
    pen.strokeStyle = color("mast");
    pen.lineWidth = 1.5;
    for (const anchor of data.anchors) trace([[anchor[0], anchor[1], ground], anchor]);
    pen.setLineDash([2, 4]);
    pen.lineWidth = 1;
    trace([data.position, [data.position[0], data.position[1], ground]]);

    /* Cables, the farthest first; below the ground thin. */
    const strands = shownSolutions().flatMap((k) => solutions[k].map((cable, i) => {
      const middle = cable.points[Math.floor(cable.points.length / 2)];
      const name = chosen === "all" ? `solution ${k + 1}, cable ${i + 1}` : `cable ${i + 1}`;
      return { cable, name, stroke: chosen === "all" ? cableColor(k) : cableColor(i), depth: see(middle)[2] };
    }));
    strands.sort((a, b) => b.depth - a.depth);
    pen.lineJoin = "round";
    for (const { cable, stroke } of strands) {
      pen.strokeStyle = stroke;
      let piece = [];
      const flush = (below) => {
        pen.lineWidth = below ? 1 : 2.4;
        pen.setLineDash(cable.slack ? [8, 5] : []);
        trace(piece);
      };
      for (const p of cable.points) {
        const last = piece[piece.length - 1];
        if (last && (p[2] < ground) !== (last[2] < ground)) {
          const t = (last[2] - ground) / (last[2] - p[2]);
          const border = add(last, add(p, last, -1), t);
          piece.push(border);
          flush(last[2] < ground);
          piece = [border];
        }
        piece.push(p);
      }
      if (piece.length > 1) flush(piece[piece.length - 1][2] < ground);
    }
    pen.setLineDash([]);

    /* The platform: what its points enclose, as seen from here. */
    const points = data.attachments.map(see);
    if (points.every((p) => p[2] > near)) {
      pen.beginPath();
      for (const p of hull(points.map(place))) pen.lineTo(...p);
      pen.closePath();
      pen.strokeStyle = color("body");
      pen.fillStyle = color("body");
      pen.lineWidth = 1.5;
      pen.globalAlpha = 0.3;
      pen.fill();
      pen.globalAlpha = 1;
      pen.stroke();
    }

    /* Names. What shares a place shares a label; labels at the platform go outwards from it. */
    const middle = place(see(data.position));
    pen.font = "600 13px system-ui, sans-serif";
    pen.textBaseline = "middle";
    pen.lineJoin = "round";
    const label = (text, [x, y], direction) => {
      const size = Math.hypot(...direction) || 1;
      const [dx, dy] = [direction[0] / size, direction[1] / size];
      pen.textAlign = dx > 0.4 ? "left" : dx < -0.4 ? "right" : "center";
      const at = [x + 9 * dx, y + 13 * dy];
      pen.strokeStyle = color("ground");
      pen.lineWidth = 4;
      pen.strokeText(text, ...at);
      pen.fillStyle = color("ink");
      pen.fillText(text, ...at);
    };
    /* 1, 2, 3, 5 as "A1–A3, A5". */
    const named = (letter, numbers) => {
      const runs = [];
      for (const n of [...numbers].sort()) {
        const last = runs[runs.length - 1];
        if (last && last[1] === n - 1) last[1] = n;
        else runs.push([n, n]);
      }
      return runs.map(([a, b]) => (a === b ? letter + a : `${letter}${a}${b === a + 1 ? ", " : "\u2013"}${letter}${b}`)).join(", ");
    };
    let around = []; // the anchors, then, apart from each other
    for (const [letter, list] of [["A", data.anchors], ["B", data.attachments]]) {
      const groups = []; // what is close together shares a label
      list.forEach((p, i) => {
        const seen = see(p);
        if (seen[2] <= near) return;
        const at = place(seen);
        pen.beginPath();
        pen.arc(...at, letter === "A" ? 4 : 2.5, 0, 2 * Math.PI);
        pen.fillStyle = color("ink");
        pen.fill();
        const group = groups.find((g) => Math.hypot(g.at[0] - at[0], g.at[1] - at[1]) < 16);
        if (group) group.numbers.push(i + 1);
        else groups.push({ at, numbers: [i + 1] });
      });
      if (letter === "A") around = groups;
      for (const { at, numbers } of groups) {
        const outwards = [at[0] - middle[0], at[1] - middle[1]];
        // From far away the platform is a point, named by its cables.
        if (letter === "A") label(named("A", numbers), at, [outwards[0] / 9, -30]);
        else if (groups.length > 1) label(named("B", numbers), at, outwards);
        else if (around.length > 1) label("B", at, [1, 0.6]);
      }
    }

    /* How deep the cables hang that leave the ground far above them. */
    pen.font = "12px system-ui, sans-serif";
    const depths = around.map((group) => group.at);
    for (const { cable, name } of strands) {
      const lowest = cable.points.reduce((low, p) => (p[2] < low[2] ? p : low));
      const seen = see(lowest);
      if (!cable.slack || ground - lowest[2] < extent.high[2] - ground || seen[2] <= near) continue;
      const [x, y] = place(seen);
      if (y < 0 || y > height || x < 0 || x > width) continue;
      if (depths.some((d) => Math.abs(d[0] - x) < 200 && Math.abs(d[1] - y) < 18)) continue;
      depths.push([x, y]);
      label(`\u2190 ${name}: ${digits(ground - lowest[2], 4)} m below the ground`, [x, y], [1, 0]);
    }
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = "left";
    pen.fillStyle = color("grey");
    pen.fillText(`grid ${digits(step)} m`, 10, height - 12);
  }
  redraws.push(drawRobot, describe);

  /** A short line as in the picture. */
  function sample(stroke, slack) {
    const space = "http://www.w3.org/2000/svg";
    const svg = document.createElementNS(space, "svg");
    const line = document.createElementNS(space, "line");
    for (const [name, value] of Object.entries({ width: 34, height: 8, "aria-hidden": "true" })) svg.setAttribute(name, value);
    const look = { x1: 0, x2: 34, y1: 4, y2: 4, stroke, "stroke-width": 3, "stroke-dasharray": slack ? "8 5" : "none" };
    for (const [name, value] of Object.entries(look)) line.setAttribute(name, value);
    svg.append(line);
    return svg;
  }

  /** What is to be said of a solution wherever it is named. */
  const doubt = (k) => (data.solutions[k].doubt ? `, ${data.solutions[k].doubt}` : "");

  /** The key below the picture, in words what is shown, and which tables are. */
  function describe() {
    const item = (stroke, slack, text) => {
      const li = document.createElement("li");
      li.append(sample(stroke, slack), text);
      return li;
    };
    const largest = (cables, of) => cables.reduce((best, cable, i) => (of(cable) > of(cables[best]) ? i : best), 0);
    if (chosen === null) {
      $("shown").textContent = "No solution: the robot without its cables.";
    } else if (chosen === "all") {
      $("key").replaceChildren(...solutions.map((_, k) => item(cableColor(k), false, `solution ${k + 1}${doubt(k)}`)),
        item(color("grey"), true, "slack"));
      $("shown").textContent = `All ${solutions.length} solutions over each other.`;
    } else {
      const cables = solutions[chosen];
      $("key").replaceChildren(...cables.map((cable, i) =>
        item(cableColor(i), cable.slack, `${i + 1}: ${cable.length.toFixed(3)} m${cable.slack ? ", slack" : ""}`)));
      const [long, tense] = [largest(cables, (c) => c.length), largest(cables, (c) => c.tension)];
      const slack = cables.flatMap((cable, i) => (cable.slack ? [i + 1] : []));
      $("shown").textContent = `Solution ${chosen + 1} of ${solutions.length}${doubt(chosen)}: longest is cable ${long + 1}, ` +
        `${cables[long].length.toFixed(3)} m; highest tension ${digits(cables[tense].tension, 4)} N in cable ${tense + 1}; ` +
        (slack.length ? `slack: ${slack.join(", ")}.` : "none is slack.");
    }
    for (const table of document.querySelectorAll(".solution")) {
      table.classList.toggle("chosen", chosen === "all" || Number(table.dataset.solution) === chosen + 1);
    }
  }

  for (const radio of document.querySelectorAll("input[name=solution]")) {
    radio.addEventListener("change", () => {
      chosen = radio.value === "all" ? "all" : Number(radio.value) - 1;
      describe();
      drawRobot();
    });
    if (radio.checked) { // by the page, or kept by the browser over a reload
      chosen = radio.value === "all" ? "all" : Number(radio.value) - 1;
    }
  }

  let fitting = null; // what the view has been fitted to and nobody has changed since
  const turnBy = (turn, tilt) => {
    view.turn += turn;
    view.tilt = Math.max(-1.57, Math.min(1.57, view.tilt + tilt));
  };
  const zoomBy = (ratio) => { view.distance *= ratio; };
  const moveBy = (x, y) => {
    const { right, up } = axes();
    const perPx = (2 * view.distance * Math.tan(FIELD)) / Math.min(picture.clientWidth, picture.clientHeight);
    view.target = add(add(view.target, right, -x * perPx), up, y * perPx);
  };
  const actions = {
    left: () => turnBy(0.15, 0), right: () => turnBy(-0.15, 0),
    up: () => turnBy(0, 0.1), down: () => turnBy(0, -0.1),
    in: () => zoomBy(1 / 1.25), out: () => zoomBy(1.25),
    top: () => { view.turn = 0; view.tilt = Math.PI / 2; fit(fixed); },
    side: () => { view.tilt = 0; fit(fixed); },
    reset,
    all: () => fit([...fixed, ...shownSolutions().flatMap((k) => solutions[k].flatMap((cable) => cable.points))]),
  };
  function act(name) {
    actions[name]();
    fitting = ["top", "side", "reset", "all"].includes(name) ? name : null;
    drawRobot();
  }
  for (const button of document.querySelectorAll("[data-view]")) {
    button.addEventListener("click", () => act(button.dataset.view));
  }
  picture.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const moves = { ArrowLeft: [30, 0], ArrowRight: [-30, 0], ArrowUp: [0, 30], ArrowDown: [0, -30] };
    const names = {
      ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down",
      "+": "in", "=": "in", "-": "out", 0: "reset", Home: "reset", f: "all", F: "all",
    };
    if (event.shiftKey && moves[event.key]) {
      fitting = null;
      moveBy(...moves[event.key]);
      drawRobot();
    } else if (names[event.key]) {
      act(names[event.key]);
    } else {
      return;
    }
    event.preventDefault();
  });
  picture.addEventListener("wheel", (event) => {
    // Otherwise the page scrolls, as it should.
    if (document.activeElement !== picture && !event.ctrlKey) return;
    event.preventDefault();
    fitting = null;
    zoomBy(Math.exp(Math.max(-0.5, Math.min(0.5, event.deltaY * 0.0015))));
    drawRobot();
  }, { passive: false });
  const fingers = new Map();
  picture.addEventListener("pointerdown", (event) => {
    picture.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  picture.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    fitting = null;
    const apart = () => {
      const [a, b] = [...fingers.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]);
    };
    const now = [event.clientX, event.clientY];
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    if (fingers.size === 2) {
      const was = apart();
      fingers.set(event.pointerId, now);
      zoomBy(Math.max(0.5, Math.min(2, was / Math.max(1, apart()))));
    } else {
      fingers.set(event.pointerId, now);
      if (event.shiftKey || event.buttons & 6) moveBy(dx, dy);
      else turnBy(dx * 0.008, dy * 0.008);
    }
    drawRobot();
  });
  for (const end of ["pointerup", "pointercancel"]) {
    picture.addEventListener(end, (event) => fingers.delete(event.pointerId));
  }

  /* ---- The workspace ---- */

  /* matplotlib's viridis at every twentieth. */
  const VIRIDIS = ("440154 481467 482576 463480 414487 3b528b 355f8d 2f6c8e 2a788e 25848e 21918c " +
    "1e9c89 22a884 2fb47c 44bf70 5ec962 7ad151 9bd93c bddf26 dfe318 fde725").split(" ")
    .map((hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)));
  function viridis(share) {
    const at = Math.max(0, Math.min(1, share)) * (VIRIDIS.length - 1);
    const k = Math.min(VIRIDIS.length - 2, Math.floor(at));
    const mix = VIRIDIS[k].map((c, i) => Math.round(c + (at - k) * (VIRIDIS[k + 1][i] - c)));
    return mix;
  }
  const css = (rgb) => `rgb(${rgb.join()})`;
  const parsed = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
  /* Words differ by colour and by a number. */
  const WORDS = ["#56b4e9", "#e69f00", "#009e73", "#f0e442", "#cc79a7", "#d55e00", "#0072b2"].map(parsed);

  function workspace({ axes: grid, quantities, unsettled }) {
    const canvas = $("slices");
    const [nx, ny] = grid.map((axis) => axis.length);
    const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
    /* How a pose is undecided, if it is: 1 for the cable model, 2 for rigid cables. */
    const doubts = new Int8Array(bytes(unsettled));
    const fields = quantities.map(({ key, name, unit, kind, data: encoded }) => {
      const isNumber = kind === "number";
      const raw = kind === "name" ? encoded.bytes : encoded;
      const values = isNumber ? new Float32Array(bytes(raw)) : new Int8Array(bytes(raw));
      const has = (k) => (isNumber ? !Number.isNaN(values[k]) : values[k] !== -128);
      let [low, high] = [Infinity, -Infinity];
      values.forEach((v, k) => {
        if (has(k) && Number.isFinite(v)) [low, high] = [Math.min(low, v), Math.max(high, v)];
      });
      const isLog = isNumber && low > 0 && high / low > 30;
      const share = (v) => (high > low ? (isLog ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low)) : 0.5);
      const names = kind === "name" ? encoded.names : null;
      const paint = (v) => (names ? WORDS[v % WORDS.length] : viridis(share(v)));
      const none = key === "change" ? "none" : "no value";
      const known = (k) => {
        if (!has(k)) return none;
        return names ? names[values[k]] : digits(values[k]) + (unit ? " " + unit : "");
      };
      const text = (k) => {
        const isAboutRigid = key.startsWith("rigid_");
        if (!doubts[k] || key === "status" || (isAboutRigid && doubts[k] !== 2)) return known(k);
        if (!has(k)) return "undecided";
        return key.endsWith("solutions") ? `at least ${known(k)}` : names ? known(k) : `${known(k)}, of those found`;
      };
      return { key, name, unit, values, has, low, high, isLog, names, paint, none, text };
    });
    let [field, axis, cursor] = [fields[0], 2, [0, 0, 0]];
    const nearest = (list, value) => list.reduce((best, v, k) => (Math.abs(v - value) < Math.abs(list[best] - value) ? k : best), 0);
    cursor = grid.map((list, k) => nearest(list, data.position[k]));
    const index = ([x, y, z]) => (z * ny + y) * nx + x;
    const flat = () => [0, 1, 2].filter((k) => k !== axis); // across and upwards
    const NAMES = ["x", "y", "z"];
    const stepOf = (k) => (grid[k].length > 1 ? (grid[k][grid[k].length - 1] - grid[k][0]) / (grid[k].length - 1) : 1);

    for (const [k, { name }] of fields.entries()) $("quantity").add(new Option(name, k));

    /** Where the slice is on the canvas: its corner, and the size of a cell. */
    let frame = null;
    function layout() {
      const [h, v] = flat();
      const width = Math.min(620, canvas.parentElement.clientWidth) - 2;
      const [cols, rowsUp] = [grid[h].length, grid[v].length];
      const [left, below, margin] = [58, 44, 12];
      const room = [width - left - margin, Math.min(500, Math.max(260, width))];
      const [sx, sy] = [Math.abs(stepOf(h)), Math.abs(stepOf(v))];
      const perM = Math.min(room[0] / (cols * sx), room[1] / (rowsUp * sy));
      const cell = [perM * sx, perM * sy];
      canvas.style.width = `${Math.round(cell[0] * cols + left + margin)}px`;
      canvas.style.height = `${Math.round(cell[1] * rowsUp + below + margin)}px`;
      frame = { left, top: margin, cell, cols, rowsUp };
    }

    /** The slice, a pixel for each pose; kept, because the cursor moves more often than it changes. */
    let slice = { name: null, canvas: null };
    function pixels() {
      const name = [field.key, axis, cursor[axis]].join();
      if (slice.name !== name) {
        const [h, v] = flat();
        const { cols, rowsUp } = frame;
        const image = new ImageData(cols, rowsUp);
        const at = [...cursor];
        for (let j = 0; j < rowsUp; j++) {
          for (let i = 0; i < cols; i++) {
            [at[h], at[v]] = [i, j];
            const k = index(at);
            if (field.has(k)) image.data.set([...field.paint(field.values[k]), 255], 4 * ((rowsUp - 1 - j) * cols + i));
          }
        }
        const canvas = Object.assign(document.createElement("canvas"), { width: cols, height: rowsUp });
        canvas.getContext("2d").putImageData(image, 0, 0);
        slice = { name, canvas };
      }
      return slice.canvas;
    }

    /** Black and white stripes; over cells smaller than those, a chequered ground, which no cell is too small for. */
    function hatch(pen, size) {
      const tile = document.createElement("canvas");
      tile.width = tile.height = size > 24 ? 12 : size > 8 ? 6 : 2;
      const stripes = tile.getContext("2d");
      for (let i = 0; i < tile.width; i++) {
        for (const [paint, x] of [["#000", i], ["#fff", (i + 1) % tile.width]]) {
          stripes.fillStyle = paint;
          stripes.fillRect(x, i, 1, 1);
        }
      }
      return pen.createPattern(tile, "repeat");
    }

    function draw() {
      layout();
      const { pen } = prepare(canvas);
      const [h, v] = flat();
      const { left, top, cell, cols, rowsUp } = frame;
      const corner = (i, j) => [left + i * cell[0], top + (rowsUp - 1 - j) * cell[1]];
      pen.imageSmoothingEnabled = false;
      pen.drawImage(pixels(), left, top, cols * cell[0], rowsUp * cell[1]);
      pen.font = `700 ${Math.min(14, cell[1] * 0.7)}px sans-serif`;
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.lineWidth = 1;
      pen.strokeStyle = color("line");
      const small = Math.min(...cell);
      const at = [...cursor];
      pen.fillStyle = hatch(pen, small);
      for (let i = 0; i < cols && doubts.length; i++) {
        for (let j = 0; j < rowsUp; j++) {
          [at[h], at[v]] = [i, j];
          if (doubts[index(at)]) pen.fillRect(...corner(i, j), ...cell);
        }
      }
      for (let i = 0; i < cols && small > 4; i++) {
        for (let j = 0; j < rowsUp; j++) {
          [at[h], at[v]] = [i, j];
          const k = index(at);
          const [x, y] = corner(i, j);
          if (!field.has(k)) { // struck through
            pen.beginPath();
            pen.moveTo(x, y + cell[1]);
            pen.lineTo(x + cell[0], y);
            pen.stroke();
          } else if (field.names && small > 9) {
            pen.fillStyle = "#000";
            pen.fillText(field.values[k] + 1, x + cell[0] / 2, y + cell[1] / 2);
          }
        }
      }
      pen.strokeStyle = color("edge");
      pen.lineWidth = 1;
      pen.strokeRect(left, top, cols * cell[0], rowsUp * cell[1]);

      /* Axes. */
      pen.fillStyle = color("ink");
      pen.font = "12px system-ui, sans-serif";
      const ticks = (k, size, put) => {
        const list = grid[k], length = list.length * size;
        const span = Math.abs(list[list.length - 1] - list[0]);
        if (!span) { put(0, list[0]); return; }
        const step = roundStep((span * 52) / length);
        for (let t = Math.ceil(list[0] / step - 1e-9); t * step <= list[list.length - 1] + 1e-9 * span; t++) {
          put((t * step - list[0]) / stepOf(k), t * step);
        }
      };
      const bottom = top + rowsUp * cell[1];
      ticks(h, cell[0], (i, value) => {
        const x = left + (i + 0.5) * cell[0];
        pen.fillRect(x - 0.5, bottom, 1, 4);
        pen.textAlign = "center";
        pen.fillText(digits(value, 4), x, bottom + 13);
      });
      ticks(v, cell[1], (j, value) => {
        const y = top + (rowsUp - 0.5 - j) * cell[1];
        pen.fillRect(left - 4, y - 0.5, 4, 1);
        pen.textAlign = "right";
        pen.fillText(digits(value, 4), left - 7, y);
      });
      pen.textAlign = "center";
      pen.font = "600 12px system-ui, sans-serif";
      pen.fillText(`${NAMES[h]} (m)`, left + (cols * cell[0]) / 2, bottom + 31);
      pen.save();
      pen.translate(12, top + (rowsUp * cell[1]) / 2);
      pen.rotate(-Math.PI / 2);
      pen.fillText(`${NAMES[v]} (m)`, 0, 0);
      pen.restore();

      /* The cursor. */
      const [cx, cy] = corner(cursor[h], cursor[v]);
      for (const [stroke, thick] of [["#fff", 4], ["#000", 2]]) {
        pen.strokeStyle = stroke;
        pen.lineWidth = thick;
        pen.strokeRect(cx, cy, cell[0], cell[1]);
      }

      /* The pose of the report, if it is over the grid. */
      const steps = (k) => (data.position[k] - grid[k][0]) / stepOf(k);
      const x = left + (steps(h) + 0.5) * cell[0], y = top + (rowsUp - 0.5 - steps(v)) * cell[1];
      if (x >= left && x <= left + cols * cell[0] && y >= top && y <= bottom) {
        const inSlice = Math.abs(steps(axis) - cursor[axis]) <= 0.5;
        for (const [stroke, thick] of [["#fff", 5], ["#000", 2]]) {
          pen.strokeStyle = stroke;
          pen.lineWidth = thick;
          pen.setLineDash(inSlice ? [] : [3, 3]);
          pen.beginPath();
          pen.moveTo(x - 9, y); pen.lineTo(x + 9, y);
          pen.moveTo(x, y - 9); pen.lineTo(x, y + 9);
          pen.stroke();
        }
        pen.setLineDash([]);
      }
    }

    function legend() {
      const box = (paint, text, letter = "") => {
        const entry = document.createElement("span"), square = document.createElement("span");
        square.className = "box";
        if (paint) Object.assign(square.style, { background: paint, color: "#000" });
        else square.style.background = `linear-gradient(135deg, transparent 46%, ${color("edge")} 46% 54%, transparent 54%)`;
        square.textContent = letter;
        entry.append(square, text);
        return entry;
      };
      const entries = [];
      if (field.names) {
        field.names.forEach((name, k) => entries.push(box(css(field.paint(k)), name, k + 1)));
      } else if (field.low <= field.high && Number.isInteger(field.low) && field.high - field.low <= 12 && !(field.values instanceof Float32Array)) {
        for (let v = field.low; v <= field.high; v++) entries.push(box(css(field.paint(v)), digits(v)));
      } else if (field.low <= field.high) {
        const ramp = document.createElement("span");
        ramp.className = "ramp";
        ramp.style.background = `linear-gradient(to right, ${Array.from({ length: 21 }, (_, k) => css(viridis(k / 20))).join()})`;
        const unit = field.unit ? " " + field.unit : "";
        const scale = document.createElement("span");
        scale.className = "scale";
        scale.append(digits(field.low, 4) + unit, ramp, digits(field.high, 4) + unit + (field.isLog ? " (logarithmic)" : ""));
        entries.push(scale);
      }
      const isPartial = field.values.some((_, k) => !field.has(k));
      if (isPartial) entries.push(box(null, field.none));
      if (doubts.length) {
        const entry = box("repeating-linear-gradient(45deg, #000 0 1px, #fff 1px 2px, transparent 2px 5px)",
          "undecided: there may be more solutions");
        entry.id = "undecided";
        entries.push(entry);
      }
      const title = document.createElement("strong");
      title.textContent = field.name;
      $("legend").replaceChildren(title, ...entries);
    }

    function read() {
      const place = grid.map((list, k) => `${NAMES[k]} ${digits(list[cursor[k]])}`).join(", ");
      const k = index(cursor);
      const rows = [["pose", `${place} m`], ...fields.map(({ name, text }) => [name, text(k)])];
      $("readout").replaceChildren(...rows.flatMap(([name, value]) => {
        const [term, said] = [document.createElement("dt"), document.createElement("dd")];
        term.textContent = name;
        said.textContent = value;
        return [term, said];
      }));
    }

    function setSlice() {
      const slider = $("slice");
      slider.max = grid[axis].length - 1;
      slider.value = cursor[axis];
      const at = `${NAMES[axis]} = ${digits(grid[axis][cursor[axis]])} m`;
      $("slice-name").textContent = `at ${at}`;
      slider.setAttribute("aria-label", `Slice across ${NAMES[axis]}`);
      slider.setAttribute("aria-valuetext", at);
    }
    const update = () => { setSlice(); draw(); read(); };

    $("quantity").addEventListener("change", (event) => { field = fields[event.target.value]; legend(); draw(); });
    $("axis").addEventListener("change", (event) => { axis = Number(event.target.value); update(); });
    $("slice").addEventListener("input", (event) => { cursor[axis] = Number(event.target.value); update(); });
    const clamp = (k, value) => Math.max(0, Math.min(grid[k].length - 1, value));
    canvas.addEventListener("pointermove", (event) => {
      const edge = canvas.getBoundingClientRect();
      const [h, v] = flat();
      const i = Math.floor((event.clientX - edge.left - canvas.clientLeft - frame.left) / frame.cell[0]);
      const j = frame.rowsUp - 1 - Math.floor((event.clientY - edge.top - canvas.clientTop - frame.top) / frame.cell[1]);
      if (clamp(h, i) !== i || clamp(v, j) !== j) return;
      if (cursor[h] === i && cursor[v] === j) return;
      [cursor[h], cursor[v]] = [i, j];
      draw();
      read();
    });
    canvas.addEventListener("keydown", (event) => {
      const [h, v] = flat();
      const moves = {
        ArrowLeft: [h, -1], ArrowRight: [h, 1], ArrowUp: [v, 1], ArrowDown: [v, -1], PageUp: [axis, 1], PageDown: [axis, -1],
      };
      const move = moves[event.key];
      if (!move || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      cursor[move[0]] = clamp(move[0], cursor[move[0]] + move[1]);
      update();
    });
    redraws.push(draw, legend);
    update();
    legend();
  }

  describe();
  act("reset");
  if (data.workspace) workspace(data.workspace);
  applyTheme();
  let width = document.body.clientWidth;
  addEventListener("resize", () => {
    if (document.body.clientWidth === width) return;
    width = document.body.clientWidth;
    if (fitting) actions[fitting]();
    for (const redraw of redraws) redraw();
  });
})();
