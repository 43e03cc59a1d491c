"use strict";
// Feeds the replay with a drive as it happens: the first event has what the replay begins with, the others are appended.
(() => {
  const get = (id) => document.getElementById(id);
  const events = new EventSource(`events${location.search}`)  // with the token;
  let over = false;

  events.addEventListener("stretch", (event) => {
    if (window.watchedReplay) return window.watchedReplay.append(JSON.parse(event.data));
    get("run").textContent = event.data;
    get("player").hidden = false;
    const script = document.createElement("script");
    script.textContent = get("replay-script").textContent;
    document.body.append(script);
    get("watching").textContent = "driving; go back in time and on, press end to follow the drive again";
  });
  events.addEventListener("end", (event) => {
    over = true;
    events.close();
    get("watching").textContent = JSON.parse(event.data);
  });
  events.onerror = () => { if (!over) get("watching").textContent = "the drive does not answer; it may have ended"; };
})();
