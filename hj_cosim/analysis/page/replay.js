"use strict";
// Plays the run whose data stands in the script element "run": arrays, one entry a sample, and for each sample a
// slice of the arrays of the cars near the robot. Road frame, SI. Texts reach the page through textContent only.
(() => {
  const raw = JSON.parse(document.getElementById("run").textContent);
  const kinds = { f4: Float32Array, f8: Float64Array, u4: Uint32Array, u1: Uint8Array };
  const decode = ({ kind, data }) => {
    const text = atob(data);
    const bytes = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
    return new kinds[kind](bytes.buffer);
  };
  const robot = Object.fromEntries(Object.entries(raw.robot).map(([name, column]) => [name, decode(column)]));
  const cars = Object.fromEntries(Object.entries(raw.cars).map(([name, column]) => [name, decode(column)]));
  let last = robot.time.length - 1;
  const get = (id) => document.getElementById(id);
  const canvas = get("view");
  const pen = canvas.getContext("2d");
  const rates = [...get("rate").options].map((option) => option.value);

  const behind = 50, ahead = 100;  // m in view
  const scale = canvas.width / (behind + ahead);
  // On a bend: the road's line d = 0 every few metres of s, and its lanes by stretches; the view looks along the road.
  const bend = raw.bend && { ...raw.bend, x: decode(raw.bend.x), y: decode(raw.bend.y), heading: decode(raw.bend.heading) };
  const roadTop = 12, roadHeight = (bend ? bend.high - bend.low : raw.lanes * raw.laneWidth) * scale;
  const strips = [
    { top: 0, name: "speed (m/s)", curves: [["plan_speed", "#6b6b6b"], ["speed", "#0072b2"]] },
    { top: 0, name: "least value V (m)", curves: [["value", "#d55e00"]], limits: [-10, 30] },
  ];
  const stripHeight = 70;
  strips.forEach((strip, number) => { strip.top = roadTop + roadHeight + 22 + number * (stripHeight + 14); });
  canvas.height = Math.ceil(strips[1].top + stripHeight + 8);
  function fitStrips() {
    const speeds = [...robot.speed, ...robot.plan_speed].filter(Number.isFinite);
    strips[0].limits = [
      speeds.reduce((a, b) => Math.min(a, b), Infinity) - 1,
      speeds.reduce((a, b) => Math.max(a, b), -Infinity) + 1,
    ];
  }

  let sample = 0, playing = false, selected = -1, clock = 0, played = 0;

  const toX = (dx) => (dx + behind) * scale;
  const toY = (y) => roadTop + ((bend ? bend.high : (raw.lanes - 0.5) * raw.laneWidth) - y) * scale;
  const span = () => Math.max(last, (raw.expected || 0) - 1);  // of a drive that is watched, more is to come
  const timeX = (k) => 8 + (canvas.width - 16) * (span() ? k / span() : 0);

  function colour(value) {
    const limit = raw.valueLimit;
    const share = (Math.min(Math.max(value, -limit), limit) + limit) / (2 * limit);
    return raw.colours[Math.round(share * (raw.colours.length - 1))];
  }

  function inWorld(s, d) {  // x, y and the road's heading there, between two places of its line
    const at = Math.min(Math.max((s - bend.start) / bend.every, 0), bend.x.length - 1.000001);
    const k = Math.floor(at), share = at - k;
    const between = (column) => column[k] + share * (column[k + 1] - column[k]);
    const heading = between(bend.heading);
    return [between(bend.x) - d * Math.sin(heading), between(bend.y) + d * Math.cos(heading), heading];
  }

  function place(dx, y, heading) {  // pixels and heading of what is dx m ahead of the robot, y m to the left of d = 0
    if (!bend) return [toX(dx), toY(y), heading];
    const [fromX, fromY, looks] = inWorld(robot.x[sample], 0);
    const [x, up, along] = inWorld(robot.x[sample] + dx, y);
    const cos = Math.cos(looks), sin = Math.sin(looks);
    return [
      toX((x - fromX) * cos + (up - fromY) * sin), toY((up - fromY) * cos - (x - fromX) * sin), heading + along - looks,
    ];
  }

  function body(x, y, heading, length, width, fill, edge, line) {
    const [across, down, turned] = place(x, y, heading);
    pen.save();
    pen.translate(across, down);
    pen.rotate(-turned);
    pen.fillStyle = fill; pen.strokeStyle = edge; pen.lineWidth = line;
    pen.fillRect(-length / 2 * scale, -width / 2 * scale, length * scale, width * scale);
    pen.strokeRect(-length / 2 * scale, -width / 2 * scale, length * scale, width * scale);
    pen.restore();
  }

  function line(from, to, d, onward) {  // a line of the road, from one dx to another
    const steps = Math.max(Math.ceil(Math.abs(to - from) / 4), 1);
    for (let k = 0; k <= steps; k++) {
      const [x, y] = place(from + (to - from) * k / steps, d, 0);
      if (k || onward) pen.lineTo(x, y); else pen.moveTo(x, y);
    }
  }

  function drawBend() {
    pen.save();
    pen.beginPath(); pen.rect(0, 0, canvas.width, roadTop + roadHeight + 2); pen.clip();
    for (const [start, stop, right, lanes] of bend.stretches) {
      const from = Math.max(start - robot.x[sample], -behind - 10), to = Math.min(stop - robot.x[sample], ahead + 10);
      if (from >= to) continue;
      pen.fillStyle = "#f1f1ee"; pen.strokeStyle = "#9a9a9a"; pen.lineWidth = 1;
      pen.beginPath(); line(from, to, right); line(to, from, right + lanes * raw.laneWidth, true); pen.fill();
      pen.beginPath(); line(from, to, right); line(from, to, right + lanes * raw.laneWidth); pen.stroke();
      pen.setLineDash([4 * scale, 8 * scale]);
      pen.lineDashOffset = ((robot.x[sample] + from) % 12) * scale;
      for (let lane = 1; lane < lanes; lane++) { pen.beginPath(); line(from, to, right + lane * raw.laneWidth); pen.stroke(); }
      pen.setLineDash([]);
    }
    pen.restore();
  }

  function drawRoad() {
    if (bend) return drawBend();
    pen.fillStyle = "#f1f1ee";
    pen.fillRect(0, roadTop, canvas.width, roadHeight);
    pen.strokeStyle = "#9a9a9a"; pen.lineWidth = 1;
    pen.setLineDash([4 * scale, 8 * scale]);
    pen.lineDashOffset = ((robot.x[sample] - behind) % 12) * scale;
    for (let lane = 1; lane < raw.lanes; lane++) {
      const y = toY((lane - 0.5) * raw.laneWidth);
      pen.beginPath(); pen.moveTo(0, y); pen.lineTo(canvas.width, y); pen.stroke();
    }
    pen.setLineDash([]);
    pen.strokeRect(-2, roadTop, canvas.width + 4, roadHeight);
  }

  function drawPlan() {  // the same closed form as in plan_path.py
    const missing = robot.plan_speed[sample] - robot.speed[sample];
    const centre = robot.plan_lane[sample] * raw.laneWidth;
    pen.strokeStyle = "#d55e00"; pen.lineWidth = 2; pen.setLineDash([6, 5]);
    pen.beginPath();
    for (let t = 0; t <= 3.0001; t += 0.1) {
      const dx = robot.plan_speed[sample] * t - missing * (1 - Math.exp(-raw.speedRate * t)) / raw.speedRate;
      const y = centre + (robot.y[sample] - centre) * Math.exp(-raw.lateralRate * t);
      const [across, down] = place(dx, y, 0);
      if (t === 0) pen.moveTo(across, down); else pen.lineTo(across, down);
    }
    pen.stroke(); pen.setLineDash([]);
  }

  function drawCars() {
    for (let k = cars.start[sample]; k < cars.start[sample + 1]; k++) {
      const chosen = cars.vehicle[k] === selected, rogue = raw.rogues[cars.vehicle[k]];
      body(cars.dx[k], cars.y[k], cars.heading[k], cars.length[k], cars.width[k], colour(cars.value[k]),
           chosen ? "#000000" : rogue ? raw.rogueColour : "#33566b", chosen || rogue ? 3 : 1);
      if (!cars.belief) continue;  // else a ring, as opaque as it is likely that the driver means harm
      pen.globalAlpha = cars.belief[k];
      body(cars.dx[k], cars.y[k], cars.heading[k], cars.length[k] + raw.ring[0], cars.width[k] + raw.ring[1],
           "transparent", raw.suspectColour, 2);
      pen.globalAlpha = 1;
    }
    const on = robot.intervening[sample];
    body(0, robot.y[sample], robot.heading[sample], raw.robotLength, raw.robotWidth, "#d55e00",
         on ? "#f0e442" : "#000000", on ? 4 : 1.5);
  }

  function drawStrip(strip) {
    const [low, high] = strip.limits;
    const toStrip = (v) => strip.top + stripHeight * (1 - (Math.min(Math.max(v, low), high) - low) / (high - low));
    pen.fillStyle = "#f8f3b8";
    for (let k = 0; k <= last; k++) if (robot.intervening[k]) pen.fillRect(timeX(k), strip.top, 1.2, stripHeight);
    pen.strokeStyle = "#dddddd"; pen.lineWidth = 1;
    pen.strokeRect(8, strip.top, canvas.width - 16, stripHeight);
    if (low < 0) { pen.beginPath(); pen.moveTo(8, toStrip(0)); pen.lineTo(canvas.width - 8, toStrip(0)); pen.stroke(); }
    for (const [name, ink] of strip.curves) {
      pen.strokeStyle = ink; pen.lineWidth = 1.3; pen.beginPath();
      for (let k = 0; k <= last; k++) pen.lineTo(timeX(k), toStrip(robot[name][k]));
      pen.stroke();
    }
    pen.fillStyle = "#6b6b6b"; pen.font = "12px system-ui, sans-serif";
    pen.fillText(`${strip.name}, ${low.toFixed(0)} to ${high.toFixed(0)}`, 12, strip.top - 3);
  }

  // The strips change with nothing but the run: drawn once, then copied under the cursor.
  const backdrop = document.createElement("canvas");
  backdrop.width = canvas.width; backdrop.height = canvas.height;
  function drawBackdrop() {
    fitStrips();
    pen.fillStyle = "#ffffff"; pen.fillRect(0, 0, canvas.width, canvas.height);
    strips.forEach(drawStrip);
    backdrop.getContext("2d").drawImage(canvas, 0, 0);
  }
  drawBackdrop();

  const number = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : "∞");
  const write = (id, text) => { get(id).textContent = text; };

  function showState() {
    write("time", robot.time[sample].toFixed(2));
    write("speed", number(robot.speed[sample], 3));
    write("plan-speed", number(robot.plan_speed[sample], 2));
    write("plan-lane", String(robot.plan_lane[sample]));
    write("omega", number(robot.omega[sample], 4));
    write("acceleration", number(robot.acceleration[sample], 3));
    write("value", number(robot.value[sample], 3));
    const whose = robot.value_vehicle[sample];
    write("value-vehicle", whose < 0 ? "nobody" : raw.names[whose]);
    write("ttc", number(robot.ttc[sample], 3));
    write("min-gap", number(robot.min_gap[sample], 3));
    const constraints = robot.constraints[sample];
    write("intervening", robot.intervening[sample] ? `the filter intervenes, ${constraints} in K` : "");
    get("intervening").dataset.on = String(Boolean(robot.intervening[sample]));
    write("collision", robot.collision[sample] ? "collision" : "");
    get("collision").dataset.on = String(Boolean(robot.collision[sample]));
    get("scrub").value = String(sample);
  }

  function carAt(vehicle) {
    for (let k = cars.start[sample]; k < cars.start[sample + 1]; k++) if (cars.vehicle[k] === vehicle) return k;
    return -1;
  }

  function showCar() {
    get("car").hidden = selected < 0;
    if (selected < 0) return;
    write("car-name", raw.names[selected]);
    const k = carAt(selected);
    if (k < 0) {
      for (const id of ["car-value", "car-gap", "car-ttc", "car-speed"]) write(id, "not near");
      return;
    }
    const gap = Math.abs(cars.dx[k]) - (raw.robotLength + cars.length[k]) / 2;
    const inWay = cars.dx[k] > 0 && Math.abs(cars.y[k] - robot.y[sample]) < (raw.robotWidth + cars.width[k]) / 2;
    const closing = robot.speed[sample] - cars.speed[k];
    const ttc = !inWay ? Infinity : gap <= 0 ? 0 : closing > 0 ? gap / closing : Infinity;
    write("car-value", number(cars.value[k], 3));
    write("car-gap", number(gap, 3));
    write("car-ttc", number(ttc, 3));
    write("car-speed", number(cars.speed[k], 3));
  }

  function show(k) {
    sample = Math.min(Math.max(Math.round(k), 0), last);
    pen.drawImage(backdrop, 0, 0);
    drawRoad(); drawPlan(); drawCars();
    pen.strokeStyle = "#000000"; pen.lineWidth = 1.5;
    pen.beginPath(); pen.moveTo(timeX(sample), strips[0].top); pen.lineTo(timeX(sample), strips[1].top + stripHeight);
    pen.stroke();
    showState(); showCar();
  }

  function tick(now) {
    if (!playing) return;
    played += (now - clock) / 1000 * Number(get("rate").value);
    clock = now;
    let k = sample;
    while (k < last && robot.time[k + 1] <= played) k++;
    if (k !== sample) show(k);
    if (k >= last) return pause();
    requestAnimationFrame(tick);
  }

  function play() {
    if (sample >= last) show(0);
    playing = true; clock = performance.now(); played = robot.time[sample];
    get("play").textContent = "pause";
    requestAnimationFrame(tick);
  }

  function pause() { playing = false; get("play").textContent = "play"; }
  const toggle = () => (playing ? pause() : play());
  function seek(k) { show(k); played = robot.time[sample]; write("message", ""); }

  function jump(flag, nothing) {  // to the next sample, from here and around, at which a flag goes up
    for (let step = 1; step <= last + 1; step++) {
      const k = (sample + step) % (last + 1);
      if (flag[k] && (k === 0 || !flag[k - 1])) { pause(); seek(k); return; }
    }
    write("message", nothing);
  }

  function lowestTtc() {
    let best = -1;
    for (let k = 0; k <= last; k++) {
      if (Number.isFinite(robot.ttc[k]) && (best < 0 || robot.ttc[k] < robot.ttc[best])) best = k;
    }
    pause();
    if (best < 0) write("message", "The robot approached no car in its way."); else seek(best);
  }

  function changeRate(by) {
    const place = rates.indexOf(get("rate").value) + by;
    if (rates[place] !== undefined) get("rate").value = rates[place];
  }

  function click(event) {
    const box = canvas.getBoundingClientRect();
    const x = (event.clientX - box.left) * canvas.width / box.width;
    const y = (event.clientY - box.top) * canvas.height / box.height;
    if (y > strips[0].top - 12) return seek((x - 8) / (canvas.width - 16) * span());
    selected = -1;
    for (let k = cars.start[sample]; k < cars.start[sample + 1]; k++) {
      const [across, down, turned] = place(cars.dx[k], cars.y[k], 0);
      const right = (x - across) / scale, up = (down - y) / scale;
      const dx = right * Math.cos(turned) + up * Math.sin(turned);
      const dy = up * Math.cos(turned) - right * Math.sin(turned);
      if (Math.abs(dx) <= cars.length[k] / 2 + 1 && Math.abs(dy) <= cars.width[k] / 2 + 0.7) selected = cars.vehicle[k];
    }
    show(sample);
  }

  const aSecond = Math.max(Math.round(raw.samplesPerSecond), 1);
  const keys = {
    " ": toggle,
    ArrowLeft: (event) => seek(sample - (event.shiftKey ? aSecond : 1)),
    ArrowRight: (event) => seek(sample + (event.shiftKey ? aSecond : 1)),
    Home: () => seek(0),
    End: () => seek(last),
    "+": () => changeRate(1),
    "-": () => changeRate(-1),
    i: () => jump(robot.intervening, "The filter never intervened."),
    t: lowestTtc,
    c: () => jump(robot.collision, "There was no collision."),
    v: () => { selected = robot.value_vehicle[sample]; show(sample); },
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.tagName === "SELECT") return;
    const action = keys[event.key];
    if (action === undefined) return;
    event.preventDefault();
    action(event);
  });
  function append(more) {  // what a watched drive has done since
    const following = sample === last && !playing;
    const longer = (column, added) => {
      const both = new column.constructor(column.length + added.length);
      both.set(column); both.set(added, column.length);
      return both;
    };
    const already = cars.vehicle.length;
    for (const [name, column] of Object.entries(more.robot)) robot[name] = longer(robot[name], decode(column));
    for (const [name, column] of Object.entries(more.cars)) {
      const added = decode(column);
      cars[name] = longer(cars[name], name === "start" ? added.slice(1).map((k) => k + already) : added);
    }
    raw.names.push(...more.names); raw.rogues.push(...more.rogues);
    last = robot.time.length - 1;
    get("scrub").max = String(last);
    drawBackdrop();
    show(following ? last : sample);
  }
  if (raw.expected) window.watchedReplay = { append };

  get("scrub").max = String(last);
  get("scrub").addEventListener("input", (event) => seek(Number(event.target.value)));
  get("play").addEventListener("click", (event) => { event.target.blur(); toggle(); });
  get("next-intervention").addEventListener("click", keys.i);
  get("lowest-ttc").addEventListener("click", keys.t);
  get("next-collision").addEventListener("click", keys.c);
  canvas.addEventListener("click", click);
  show(raw.expected ? last : 0);
})();
