// What a pointer can ask of a campaign's page; without it the page says everything in words.
"use strict";
(() => {
  const { cells, outcomes, flights } = JSON.parse(document.getElementById("flights").textContent);
  const tip = document.getElementById("tip"), panel = document.getElementById("flight");
  const shown = new Set(outcomes.map((_, index) => index));
  const charts = [...document.querySelectorAll("svg[data-points]")].map((svg) => {
    const points = svg.dataset.points.split("|").filter(Boolean).map((text) => {
      const [flight, x, y, series, good] = text.split(" ").map(Number);
      return { flight, x, y, series, good, outcome: flights[flight][2] };
    });
    const over = svg.appendChild(document.createElementNS(svg.namespaceURI, "g"));
    const ring = svg.appendChild(document.createElementNS(svg.namespaceURI, "circle"));
    ring.setAttribute("class", "ring");
    const colours = new Map();
    svg.querySelectorAll(".marks path").forEach((path) => colours.set(Number(path.dataset.series), path.getAttribute("stroke")));
    return { svg, points, over, ring, colours };
  });
  document.body.classList.add("script");

  const element = (tag, text, parent, attributes = {}) => {
    const made = document.createElement(tag);
    made.textContent = text;
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    parent.appendChild(made);
    return made;
  };
  const facts = (at) => {
    const [cell, seed, outcome, error, sink, tilt, time, reason, files] = flights[at];
    const figures = [];
    if (error !== null) figures.push(`${(100 * error).toFixed(1)} cm from the centre`);
    if (sink !== null) figures.push(`${sink.toFixed(2)} m/s down`);
    if (tilt !== null) figures.push(`tilt ${tilt.toFixed(1)}°`);
    if (time !== null) figures.push(`after ${time.toFixed(0)} s`);
    const command = cells[cell].again && cells[cell].again + seed;
    return { cell: cells[cell], seed, cause: outcomes[outcome], figures: figures.join(", "), reason, files, command };
  };

  // The landing nearest to the pointer, at most 16 px away on the screen.
  const nearest = (chart, event) => {
    const matrix = chart.svg.getScreenCTM(), at = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
    let best = null, least = 16 / matrix.a;
    for (const point of chart.points) {
      const away = Math.hypot(point.x - at.x, point.y - at.y);
      if (away < least && shown.has(point.outcome)) [best, least] = [point, away];
    }
    return best;
  };
  const mark = (flight) => {
    for (const { points, ring } of charts) {
      const point = points.find((it) => it.flight === flight);
      ring.setAttribute("r", point ? 7 : 0);
      if (point) { ring.setAttribute("cx", point.x); ring.setAttribute("cy", point.y); }
    }
  };
  const leave = () => { tip.style.display = "none"; mark(chosen); };
  let chosen = null;

  const point = (at, event) => {
    const { cell, seed, cause, figures } = facts(at);
    tip.replaceChildren();
    element("b", `seed ${seed}, ${cell.pilot}`, tip);
    element("div", figures || "no touchdown", tip);
    element("div", cause || "landed", tip);
    element("div", cell.name, tip, { class: "dim" });
    tip.style.display = "block";
    const { offsetWidth: wide, offsetHeight: high } = tip;
    tip.style.left = `${Math.max(4, Math.min(event.clientX + 14, innerWidth - wide - 8))}px`;
    tip.style.top = `${event.clientY + 18 + high > innerHeight ? event.clientY - high - 12 : event.clientY + 18}px`;
    mark(at);
  };
  const choose = (at) => {
    chosen = at;
    const { cell, seed, figures, reason, files, command } = facts(at);
    panel.replaceChildren();
    const box = element("div", "", panel);
    element("button", "×", box, { class: "close", "aria-label": "close" }).onclick = close;
    element("h3", `${cell.name}, seed ${seed}`, box);
    element("p", [reason || "landed", figures].filter(Boolean).join(": "), box);
    const links = element("p", "", box);
    for (const [name, path] of files) { element("a", name, links, { href: path }); links.append(" "); }
    if (!files.length) element("span", `No log of it is here${command ? ": the command makes one" : ""}. `, links, { class: "dim" });
    if (command) {
      element("p", `Fly it again${cell.version ? `; it was flown by version ${cell.version}` : ""}:`, box);
      const text = element("pre", command, box);
      element("button", "copy", box).onclick = async (event) => {
        try { await navigator.clipboard.writeText(command); event.target.textContent = "copied"; }
        catch { getSelection().selectAllChildren(text); }
      };
    }
    panel.style.display = "block";
    mark(at);
  };
  const close = () => { panel.style.display = "none"; chosen = null; mark(null); };

  for (const chart of charts) {
    chart.svg.addEventListener("pointermove", (event) => {
      const found = nearest(chart, event);
      if (found) point(found.flight, event); else leave();
    });
    chart.svg.addEventListener("pointerleave", leave);
    chart.svg.addEventListener("click", (event) => {
      const found = nearest(chart, event);
      if (found) { choose(found.flight); tip.style.display = "none"; }
    });
  }
  addEventListener("keydown", (event) => { if (event.key === "Escape") close(); });

  // Outcomes that are not ticked fade in the charts and leave the table of failures.
  const sift = () => {
    const all = shown.size === outcomes.length;
    for (const { svg, points, over, colours } of charts) {
      svg.classList.toggle("sifted", !all);
      const paths = new Map();
      if (!all) for (const { x, y, series, good, outcome } of points) {
        if (!shown.has(outcome)) continue;
        const key = `${series} ${good}`;
        paths.set(key, (paths.get(key) || "") + (good ? `M${x} ${y}h0` : `M${x - 3} ${y - 3}l6 6m0 -6l-6 6`));
      }
      over.replaceChildren(...[...paths].map(([key, d]) => {
        const [series, good] = key.split(" ").map(Number), path = document.createElementNS(svg.namespaceURI, "path");
        const look = { d, fill: "none", stroke: colours.get(series), "stroke-width": good ? 6 : 2, "stroke-linecap": good ? "round" : "butt" };
        for (const [name, value] of Object.entries(look)) path.setAttribute(name, value);
        return path;
      }));
    }
    for (const row of document.querySelectorAll("tr[data-outcome]")) row.hidden = !shown.has(Number(row.dataset.outcome));
  };
  for (const box of document.querySelectorAll("#outcomes input")) {
    box.addEventListener("change", () => { shown[box.checked ? "add" : "delete"](Number(box.value)); sift(); });
    if (!box.checked) shown.delete(Number(box.value)); // as a browser keeps it over a reload
  }
  outcomes.forEach((_, index) => { if (!document.querySelector(`#outcomes input[value="${index}"]`)) shown.add(index); });
  sift();
})();
