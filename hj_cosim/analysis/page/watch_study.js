"use strict";
// Shows how a study stands; every event has all of it. Texts reach the page through textContent only.
(() => {
  const get = (id) => document.getElementById(id);
  const events = new EventSource(`events${location.search}`);  // with the token
  let over = false;

  function fill(body, rows) {
    body.replaceChildren(...rows.map((cells) => {
      const row = document.createElement("tr");
      row.append(...cells.map((text) => {
        const cell = document.createElement("td");
        cell.textContent = text;
        return cell;
      }));
      return row;
    }));
  }

  events.addEventListener("state", (event) => {
    const state = JSON.parse(event.data);
    get("watching").textContent = `${state.done} of ${state.total} episodes are driven, ${state.failed} failed`;
    fill(document.querySelector("#running tbody"), state.running);
    fill(document.querySelector("#standing tbody"), state.rows);
  });
  events.addEventListener("end", (event) => {
    over = true;
    events.close();
    fill(document.querySelector("#running tbody"), []);
    get("watching").textContent = JSON.parse(event.data);
  });
  events.onerror = () => { if (!over) get("watching").textContent = "the study does not answer; it may have ended"; };
})();
