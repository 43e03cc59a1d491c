"use strict";
// A number in a study's table leads to the episodes behind it: their list opens, sorted by that metric, the worst first.
(() => {
  const number = (cell) => {
    const value = parseFloat(cell.textContent);
    return Number.isFinite(value) ? value : Infinity;
  };

  function sort(table, key, downwards) {
    const heads = [...table.tHead.rows[0].cells];
    const place = heads.findIndex((head) => head.dataset.key === key);
    if (place < 0) return;
    const rows = [...table.tBodies[0].rows];
    rows.sort((a, b) => (number(a.cells[place]) - number(b.cells[place])) * (downwards ? -1 : 1));
    table.tBodies[0].append(...rows);
    heads.forEach((head, k) => {
      if (k === place) head.setAttribute("aria-sort", downwards ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    });
  }

  function open(link) {
    const target = document.getElementById(link.hash.slice(1));
    if (!target) return;
    const list = target.closest("details");
    list.open = true;
    const table = list.querySelector("table");
    if (table) sort(table, link.dataset.metric, link.dataset.worst === "highest");
    target.focus();
  }

  document.addEventListener("click", (event) => {
    const link = event.target.closest("a[data-metric]");
    if (link) return open(link);
    const head = event.target.closest(".episodes th[data-key]");
    if (head) sort(head.closest("table"), head.dataset.key, head.getAttribute("aria-sort") === "ascending");
  });
})();
