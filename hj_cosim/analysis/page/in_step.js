"use strict";
// Moves the replays of several runs together: each plays in a frame of its own, and is put to the same time by the bar
// in it.
(() => {
  const get = (id) => document.getElementById(id);
  const frames = [...document.querySelectorAll(".side iframe")];
  let time = 0, longest = 0, playing = false, clock = 0;

  function show(wanted) {
    time = Math.min(Math.max(wanted, 0), longest);
    for (const frame of frames) {
      const bar = frame.contentDocument.getElementById("scrub");
      bar.value = String(Math.min(Math.round(time * Number(frame.dataset.rate)), Number(bar.max)));
      bar.dispatchEvent(new Event("input"));
      fit(frame);
    }
    get("time").textContent = time.toFixed(2);
    get("scrub").value = String(time);
  }

  function tick(now) {
    if (!playing) return;
    const next = time + (now - clock) / 1000 * Number(get("rate").value);
    clock = now;
    show(next);
    if (time >= longest) return pause();
    requestAnimationFrame(tick);
  }

  function play() {
    if (time >= longest) show(0);
    playing = true; clock = performance.now();
    get("play").textContent = "pause";
    requestAnimationFrame(tick);
  }

  function pause() { playing = false; get("play").textContent = "play"; }
  const toggle = () => (playing ? pause() : play());

  const keys = {
    " ": toggle,
    ArrowLeft: (event) => show(time - (event.shiftKey ? 1 : 0.02)),
    ArrowRight: (event) => show(time + (event.shiftKey ? 1 : 0.02)),
    Home: () => show(0),
    End: () => show(longest),
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.tagName === "SELECT") return;
    const action = keys[event.key];
    if (action === undefined) return;
    event.preventDefault();
    action(event);
  });
  get("play").addEventListener("click", (event) => { event.target.blur(); toggle(); });
  get("scrub").addEventListener("input", (event) => show(Number(event.target.value)));

  function fit(frame) {  // what is written below a replay takes more lines now and then
    const height = frame.contentDocument.body.scrollHeight;
    if (frame.clientHeight < height) frame.style.height = `${height}px`;
  }

  function begin() {
    for (const frame of frames) {
      const bar = frame.contentDocument.getElementById("scrub");
      longest = Math.max(longest, Number(bar.max) / Number(frame.dataset.rate));
      fit(frame);
    }
    get("scrub").max = String(longest);
    window.addEventListener("resize", () => frames.forEach((frame) => { frame.style.height = "0"; fit(frame); }));
    show(0);
    document.body.dataset.ready = "true";
  }

  if (document.readyState === "complete") begin(); else window.addEventListener("load", begin);
})();
