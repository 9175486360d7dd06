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

  // The list of pairs.
  const source = document.getElementById("pair-data");
  if (source) pairs(JSON.parse(source.textContent));

  // Tables sort by the column whose head is chosen; what has no number comes last.
  for (const table of document.querySelectorAll("table.sortable")) {
    const body = table.tBodies[0];
    for (const head of table.tHead.rows[0].cells) {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...head.childNodes);
      head.append(button);
      const isName = head.classList.contains("name");
      const column = head.cellIndex;
      const value = (row) => {
        const cell = row.cells[column];
        if (isName) return cell.textContent.trim();
        // The letters of a group stand behind the number, in an element of their own.
        const parts = [...cell.childNodes];
        const number = parts.findLast((part) => part.nodeType === Node.TEXT_NODE);
        const text = ((number ?? parts.at(-1))?.textContent ?? "").trim();
        return text === "<0.1" ? 0 : text === "–" ? null : parseFloat(text);
      };
      button.addEventListener("click", () => {
        // Names from A, numbers from the highest.
        const up = head.ariaSort ? head.ariaSort === "descending" : isName;
        for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", up ? "ascending" : "descending");
        const rows = [...body.rows].map((row) => ({ row, key: value(row) }));
        rows.sort(({ key: x }, { key: y }) => {
          if (x === y) return 0;
          if (x === null || y === null) return x === null ? 1 : -1;
          return x < y === up ? -1 : 1;
        });
        for (const { row } of rows) row.classList.remove("group");
        body.append(...rows.map(({ row }) => row));
      });
    }
  }

  // A matcher is switched in all figures at once, and stands out while its switch is pointed at or has the focus.
  const switches = [...document.querySelectorAll(".legend button")];
  const turn = (series, on) => {
    for (const twin of document.querySelectorAll(`.legend button[data-series="${series}"]`)) twin.setAttribute("aria-pressed", String(on));
    // A curve that belongs to several methods is there as long as one of them is.
    const isOff = (its) => document.querySelector(`.legend button[data-series="${its}"]`)?.getAttribute("aria-pressed") !== "true";
    for (const curve of document.querySelectorAll(`.series[data-series~="${series}"]`)) curve.classList.toggle("off", curve.dataset.series.split(" ").every(isOff));
    document.body.classList.toggle("partial", document.querySelector(".series.off") !== null);
  };
  for (const button of switches) {
    const { series } = button.dataset;
    const light = (on) => {
      document.body.classList.toggle("dim", on);
      for (const curve of document.querySelectorAll(".series")) curve.classList.toggle("lit", on && curve.matches(`[data-series~="${series}"]`));
    };
    button.addEventListener("click", () => turn(series, button.getAttribute("aria-pressed") !== "true"));
    for (const event of ["pointerenter", "focus"]) button.addEventListener(event, () => light(true));
    for (const event of ["pointerleave", "blur"]) button.addEventListener(event, () => light(false));
  }
  // Every section has a legend with the same series, and the same presets.
  const entries = [...new Map(switches.map((button) => [button.dataset.series, button])).values()];
  let isOpen = false;
  for (const preset of document.querySelectorAll(".presets button")) {
    const { only, estimator } = preset.dataset;
    const wanted = (button) => (only === "all" ? true : only === "none" ? false : button.dataset.estimator === estimator);
    const choose = () => { for (const button of entries) turn(button.dataset.series, wanted(button)); };
    preset.addEventListener("click", choose);
    if ("opening" in preset.dataset && !isOpen) {
      isOpen = true;
      choose();
    }
  }

  // Values under the pointer, best first.
  for (const chart of document.querySelectorAll(".chart.sp")) {
    const cursor = chart.querySelector(".cursor");
    const first = Number(cursor.dataset.x1);
    const count = Number(cursor.dataset.count);
    const step = (Number(cursor.dataset.x2) - first) / (count - 1);
    const unit = () => chart.getBoundingClientRect().width / chart.viewBox.baseVal.width;
    let k = 5;

    const show = (threshold, y) => {
      k = Math.max(1, Math.min(count, threshold));
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
      head.textContent = `below ${k}${cursor.dataset.unit}`;
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

  function pairs(data) {
    const PAGE = 50;
    const byId = (id) => document.getElementById(`pair-${id}`);
    const make = (tag, properties = {}, ...children) => {
      const element = Object.assign(document.createElement(tag), properties);
      element.append(...children);
      return element;
    };
    const withCode = (text) => text.split("`").map((part, k) => (k % 2 ? make("code", { textContent: part }) : part));
    const [datasets, methods, pictures, view] = ["dataset", "method", "pictures", "view"].map(byId);
    const head = byId("table").tHead.rows[0];
    const body = byId("table").tBodies[0];
    const dataset = () => data.datasets[datasets.value];
    const method = () => dataset().methods[methods.value];
    const beside = new Map(data.datasets.map((d) => [d, new Set(d.pages)]));
    const paged = () => beside.get(dataset());
    const address = (i) => `${dataset().folder}/${dataset().a[i]}-${dataset().b[i]}.html`;
    const counted = (number) => (number < 0 ? null : number);
    const degrees = (hundredths) => (hundredths < 0 ? null : hundredths / 100);
    const pose = (m, i) => (m.translation[i] < 0 ? null : Math.max(m.rotation[i], m.translation[i]) / 100);
    const corner = (m, i) => (m.corner ? degrees(m.corner[i]) : null);

    // Head, value of pair i, decimals; a column without values is left out.
    const COLUMNS = [
      ["Pair", (d, m, i) => i, null],
      ["Baseline", (d, m, i) => d.baseline[i] ?? null, 3],
      ["Angle", (d, m, i) => d.angle[i] ?? null, 1],
      ["Overlap", (d, m, i) => d.overlap[i] ?? null, 2],
      ["Selected", (d, m, i) => counted(m.selected[i]), 0],
      ["Correspondences", (d, m, i) => counted(m.correspondences[i]), 0],
      ["Error", (d, m, i) => pose(m, i), 2],
      ["Rotation", (d, m, i) => degrees(m.rotation[i]), 2],
      ["Translation", (d, m, i) => degrees(m.translation[i]), 2],
      ["Corner error (px)", (d, m, i) => corner(m, i), 2],
      ["Outcome", (d, m, i) => (m.failure[i] < 0 ? (m.corner ? "homography" : "pose") : data.failures[m.failure[i]]), null],
    ];
    let sorted = { column: 0, up: true };
    let order = [];
    let start = 0;
    let chosen = null;

    const options = (select, names) => {
      select.replaceChildren(...names.map((name, value) => make("option", { value, textContent: name })));
    };
    const name = (d, i) => `${d.a[i]} – ${d.b[i]}${d.repetition[i] ? ` (${d.repetition[i] + 1})` : ""}`;

    // What has no value comes last, whichever way it is sorted.
    const sort = () => {
      const [d, m, value] = [dataset(), method(), COLUMNS[sorted.column][1]];
      order = [...d.a.keys()].filter((i) => !pictures.checked || i in m.pictures || paged().has(i));
      const way = sorted.up ? 1 : -1;
      order.sort((i, j) => {
        const [x, y] = [value(d, m, i), value(d, m, j)];
        if (x === y) return i - j;
        if (x === null || y === null) return x === null ? 1 : -1;
        return x < y ? -way : way;
      });
      start = 0;
      draw();
    };

    const draw = () => {
      const [d, m] = [dataset(), method()];
      const used = COLUMNS.map((column, index) => ({ column, index }))
        .filter(({ column: [title] }) => ({ Baseline: d.baseline, Angle: d.angle, Overlap: d.overlap })[title]?.length !== 0)
        .filter(({ column: [title] }) => !(m.corner ? ["Error", "Rotation", "Translation"] : ["Corner error (px)"]).includes(title));
      const focused = head.contains(document.activeElement) ? document.activeElement.textContent : null;
      head.replaceChildren(...used.map(({ column: [title, , decimals], index }) => {
        const isBound = title === "Overlap" && !d.measured;
        const button = make("button", { type: "button", textContent: isBound ? "Overlap \u2264" : title });
        button.addEventListener("click", () => {
          sorted = { column: index, up: sorted.column === index ? !sorted.up : true };
          sort();
        });
        const cell = make("th", { scope: "col", className: decimals === null ? "name" : "" }, button);
        if (index === sorted.column) cell.setAttribute("aria-sort", sorted.up ? "ascending" : "descending");
        return cell;
      }));
      for (const button of head.querySelectorAll("button")) if (button.textContent === focused) button.focus();
      body.replaceChildren(...order.slice(start, start + PAGE).map((i) => {
        const open = make("button", { type: "button", textContent: name(d, i) });
        open.addEventListener("click", () => show(i));
        const first = make("th", { scope: "row", className: "name" }, open, i in m.pictures ? " \u25a3" : "");
        if (paged().has(i)) {
          first.append(" ", make("a", { href: address(i), textContent: "\u2197", title: "all matchers on this pair" }));
        }
        const row = make("tr", { className: i === chosen ? "chosen" : "" }, first);
        row.dataset.pair = i;
        for (const { column: [, value, decimals] } of used.slice(1)) {
          const x = value(d, m, i);
          const text = x === null ? "–" : decimals === null ? x : x.toFixed(decimals);
          row.append(make("td", { className: decimals === null ? "name" : "", textContent: text }));
        }
        return row;
      }));
      const end = Math.min(start + PAGE, order.length);
      const left = d.left_out ? `; ${d.left_out} more${data.all_pairs ? ` in ${data.all_pairs}` : ""}` : "";
      byId("range").textContent = order.length ? `${start + 1} to ${end} of ${order.length}${left}` : `none${left}`;
      byId("before").disabled = start === 0;
      byId("after").disabled = end === order.length;
    };

    // The address of a pair, to be sent to somebody.
    const link = (d, m, i) => `#pair=${[d.name, `${d.a[i]}-${d.b[i]}-${d.repetition[i]}`, m.matcher, m.estimator].map(encodeURIComponent).join("/")}`;
    const decoded = (part) => {
      try {
        return decodeURIComponent(part);
      } catch {
        // A % that escapes nothing.
        return part;
      }
    };
    const follow = () => {
      if (!location.hash.startsWith("#pair=")) return;
      const [name, frames, matcher, estimator] = location.hash.slice(6).split("/").map(decoded);
      const d = data.datasets.findIndex((d) => d.name === name);
      const m = d < 0 ? -1 : data.datasets[d].methods.findIndex((m) => m.matcher === matcher && m.estimator === estimator);
      const i = d < 0 ? -1 : data.datasets[d].a.findIndex((a, i) => `${a}-${data.datasets[d].b[i]}-${data.datasets[d].repetition[i]}` === frames);
      if (m < 0 || i < 0) {
        byId("range").textContent = `this page does not list the pair ${location.hash.slice(6)}`;
        return;
      }
      datasets.value = d;
      fill();
      methods.value = m;
      sort();
      show(i);
      view.scrollIntoView();
    };

    // Every matcher on pair i, the smallest error first; poses before homographies, whose errors are pixels.
    const rivals = (d, i) => {
      const error = (m) => (m.corner ? corner(m, i) : pose(m, i)) ?? Infinity;
      const by = (m, n) => Boolean(m.corner) - Boolean(n.corner) || (error(m) < error(n) ? -1 : error(m) > error(n) ? 1 : 0);
      const order = [...d.methods.keys()].sort((x, y) => by(d.methods[x], d.methods[y]) || x - y);
      const rows = order.map((index) => {
        const m = d.methods[index];
        const choose = make("button", { type: "button", textContent: m.label });
        choose.addEventListener("click", () => {
          methods.value = index;
          sort();
          show(i);
        });
        const cells = [counted(m.selected[i]) ?? "–", m.failure[i] < 0 ? counted(m.correspondences[i]) ?? "–" : "–", m.failure[i] >= 0 ? data.failures[m.failure[i]] : error(m) === Infinity ? "–" : error(m).toFixed(2) + (m.corner ? " px" : "")];
        const first = make("th", { scope: "row", className: "name" }, choose, i in m.pictures ? " \u25a3" : "");
        const row = make("tr", { className: m === method() ? "chosen" : "" }, first);
        row.append(...cells.map((textContent) => make("td", { textContent })));
        return row;
      });
      const heads = [byId("subject").textContent, "Selected", "Correspondences", "Error"];
      const head = make("tr", {}, ...heads.map((textContent, at) => make("th", { scope: "col", className: at ? "" : "name", textContent })));
      const table = make("table", {}, make("thead", {}, head), make("tbody", {}, ...rows));
      return make("div", { className: "scroll rivals", tabIndex: 0, role: "region", ariaLabel: "All on this pair" }, table);
    };

    const show = (i) => {
      const [d, m] = [dataset(), method()];
      chosen = i;
      for (const row of body.rows) row.classList.toggle("chosen", Number(row.dataset.pair) === i);
      const picture = m.pictures[i];
      const failed = m.failure[i] >= 0;
      const off = () => (m.corner ? `Corners off by ${corner(m, i)?.toFixed(2) ?? "infinitely many"} px.`
        : `Pose off by ${pose(m, i)?.toFixed(2) ?? "–"}°: rotation ${degrees(m.rotation[i]).toFixed(2)}°, translation ${degrees(m.translation[i])?.toFixed(2) ?? "–"}°.`);
      const numbers = [[m.correspondences[i], "correspondences"], [m.selected[i], "selected matches"]]
        .filter(([number]) => counted(number) !== null).map(([number, of]) => `${number} ${of}`).join(" of ");
      const words = failed ? data.reasons[m.protocol][m.failure[i]] : `${off()}${numbers ? ` ${numbers}.` : ""}`;
      const button = (textContent, action) => {
        const button = make("button", { type: "button", textContent });
        button.addEventListener("click", action);
        return button;
      };
      const beside = (step, name) => {
        const at = order.indexOf(i) + step;
        const to = button(name, () => {
          start = Math.floor(at / PAGE) * PAGE;
          draw();
          show(order[at]);
          view.querySelector(`[data-step="${step}"]:enabled`)?.focus();
        });
        to.dataset.step = step;
        to.disabled = !(at in order) || !order.includes(i);
        return to;
      };
      const close = button("Close", () => {
        view.hidden = true;
        chosen = null;
        history.replaceState(null, "", "#pairs");
        draw();
        body.querySelector(`tr[data-pair="${i}"] button`)?.focus();
      });
      view.replaceChildren(
        make("div", { className: "pages" }, beside(-1, "Previous pair"), beside(1, "Next pair"), close),
        make("h3", { textContent: `${d.name}: ${name(d, i)}, ${m.label}` }),
        make("p", {}, ...withCode(words)),
        ...(picture ? drawing(picture, failed) : paged().has(i) ? [] : [make("p", { className: "quiet", textContent: `This page has no picture of it${m.show ? "; the command below draws one" : ""}.` })]),
        ...(d.methods.length > 1 ? [rivals(d, i)] : []),
        ...(paged().has(i) ? [make("p", {}, make("a", { href: address(i), textContent: "Pictures of all on this pair" }))] : []),
        make("p", { className: "quiet" }, ...(m.show ? [d.repetition[i] ? "From the shell, as it was the first time: " : "From the shell: ", make("code", {
          textContent: `${m.show[0]} ${d.a[i]} ${d.b[i]} ${m.show[1]}`,
        }), " "] : []), make("a", { href: link(d, m, i), textContent: "Link to this pair" })),
      );
      view.hidden = false;
      history.replaceState(null, "", link(d, m, i));
      view.focus({ preventScroll: true });
      view.scrollIntoView({ block: "nearest" });
    };

    function* drawing(picture, failed) {
      const frame = make("div", { className: "picture" });
      const [a, b] = picture.sizes;
      const images = picture.images.map((index, side) => {
        const image = make("img", { src: data.images[index], alt: side ? "image b" : "image a" });
        image.style.width = `${(99.2 * picture.sizes[side][0]) / (a[0] + b[0])}%`;
        return image;
      });
      frame.append(...images);
      // Our own drawing; the only text in it is ours.
      frame.insertAdjacentHTML("beforeend", picture.drawing);
      yield frame;
      const switches = [
        ...(failed ? [] : [
          ["agrees", `${picture.agree} agree with the estimate (solid)`],
          ["differs", `${picture.matches - picture.agree} do not (dashed)`],
        ]),
        ["epipolar", "epipolar lines, or the frame of the first image: true white, estimated yellow"],
      ];
      const boxes = switches.map(([part, text]) => {
        const box = make("input", { type: "checkbox", checked: true });
        box.addEventListener("change", () => frame.classList.toggle(`no-${part}`, !box.checked));
        return make("label", {}, box, text);
      });
      if (frame.querySelector(".keypoints")) {
        const box = make("input", { type: "checkbox" });
        box.addEventListener("change", () => frame.classList.toggle("keypoints", box.checked));
        boxes.push(make("label", {}, box, "keypoints"));
      } else {
        boxes.push(make("span", { className: "quiet", textContent: "no keypoints: they were not in the feature cache (report --cache)" }));
      }
      yield make("div", { className: "choices" }, ...boxes);
      const classes = data.distances.map(([colour, text], at) => {
        const sample = make("i");
        sample.style.background = colour;
        return make("li", {}, sample, picture.by_distance ? `${text}: ${picture.by_distance[at]}` : text);
      });
      yield make("ul", { className: "colours" }, ...classes, make("li", { textContent: "from the true epipolar line, or place" }),
        make("li", { textContent: picture.drawn < picture.matches ? `${picture.drawn} of ${picture.matches} matches are drawn` : "all matches are drawn" }));
    }

    const restart = () => {
      view.hidden = true;
      chosen = null;
      sort();
    };
    options(datasets, data.datasets.map((d) => d.name));
    const fill = () => {
      const label = methods.selectedOptions[0]?.textContent;
      const labels = dataset().methods.map((m) => m.label);
      options(methods, labels);
      methods.value = Math.max(0, labels.indexOf(label));
      restart();
    };
    datasets.addEventListener("change", fill);
    methods.addEventListener("change", restart);
    pictures.addEventListener("change", sort);
    byId("before").addEventListener("click", () => { start = Math.max(0, start - PAGE); draw(); });
    byId("after").addEventListener("click", () => { start += PAGE; draw(); });
    fill();
    addEventListener("hashchange", follow);
    follow();
  }
})();
