"use strict";
(() => {
  const tip = document.getElementById("tip");

  // Shows the tooltip beside a point of the screen, inside the window.
  const place = (x, y) => {
    tip.hidden = false;
    const { width, height } = tip.getBoundingClientRect();
    const left = x + 14 + width > innerWidth - 8 ? x - 14 - width : x + 14;
    tip.style.left = `${Math.max(8, Math.min(left, innerWidth - width - 8))}px`;
    tip.style.top = `${Math.max(8, Math.min(y + 14, innerHeight - height - 8))}px`;
  };
  const hide = () => { tip.hidden = true; };

  // Intervals of the AUC table.
  for (const cell of document.querySelectorAll("[data-tip]")) {
    const show = () => {
      tip.textContent = cell.dataset.tip;
      const box = cell.getBoundingClientRect();
      place(box.right - 20, box.bottom - 8);
    };
    cell.addEventListener("pointerenter", show);
    cell.addEventListener("focus", show);
    cell.addEventListener("pointerleave", hide);
    cell.addEventListener("blur", hide);
  }

  // A matcher is switched in all figures at once.
  for (const button of document.querySelectorAll(".legend button")) {
    button.addEventListener("click", () => {
      const off = button.getAttribute("aria-pressed") === "true";
      button.setAttribute("aria-pressed", String(!off));
      for (const series of document.querySelectorAll(`.series[data-series="${button.dataset.series}"]`)) {
        series.classList.toggle("off", off);
      }
    });
  }

  // Values under the pointer, best first.
  for (const chart of document.querySelectorAll(".chart.sp")) {
    const cursor = chart.querySelector(".cursor");
    const first = Number(cursor.dataset.x1);
    const step = (Number(cursor.dataset.x15) - first) / 14;
    const unit = () => chart.getBoundingClientRect().width / chart.viewBox.baseVal.width;
    let k = 5;

    const show = (threshold, y) => {
      k = Math.max(1, Math.min(15, threshold));
      const x = first + (k - 1) * step;
      cursor.setAttribute("x1", x);
      cursor.setAttribute("x2", x);
      cursor.setAttribute("visibility", "visible");
      const rows = [...chart.querySelectorAll(".series:not(.off)")].map((series) => ({
        colour: series.classList[1],
        name: series.dataset.name,
        value: series.dataset.values.split(" ")[k - 1],
      }));
      rows.sort((a, b) => b.value - a.value);
      const head = document.createElement("b");
      head.textContent = `below ${k}°`;
      tip.replaceChildren(head, ...rows.map(({ colour, name, value }) => {
        const row = document.createElement("div");
        row.className = `value ${colour}`;
        const label = document.createElement("span");
        label.textContent = name;
        const number = document.createElement("span");
        number.textContent = value;
        row.append(document.createElement("i"), label, number);
        return row;
      }));
      const box = chart.getBoundingClientRect();
      place(box.left + x * unit(), y ?? box.top + box.height / 3);
    };
    const leave = () => {
      cursor.setAttribute("visibility", "hidden");
      hide();
    };

    const point = (event) => {
      const x = (event.clientX - chart.getBoundingClientRect().left) / unit();
      show(Math.round((x - first) / step) + 1, event.clientY);
    };
    chart.addEventListener("pointermove", point);
    chart.addEventListener("pointerdown", point);
    chart.addEventListener("pointerleave", leave);
    chart.addEventListener("blur", leave);
    chart.addEventListener("keydown", (event) => {
      const move = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (event.key === "Escape") leave();
      if (!move) return;
      event.preventDefault();
      show(tip.hidden ? k : k + move);
    });
  }
})();
