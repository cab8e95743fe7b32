// The desk: asks the server every two seconds how things are. All text is set as text, never as markup.
"use strict";
const at = (id) => document.getElementById(id);
const code = at("code");
code.value = sessionStorage.getItem("code") ?? "";
code.addEventListener("change", () => sessionStorage.setItem("code", code.value));
let planned = 0;
/** Keys of what this browser has uploaded, by the number of the job: they show that it is its own. */
const MOST_KEYS = 50;
const keys = new Map(JSON.parse(localStorage.getItem("keys") ?? "[]"));
function remember(job, key) {
  keys.delete(job);
  keys.set(job, key);
  for (const oldest of [...keys.keys()].slice(0, -MOST_KEYS)) keys.delete(oldest);
  localStorage.setItem("keys", JSON.stringify([...keys]));
}
const headers = () => ({ "x-foilpress-code": code.value, "x-foilpress-keys": [...keys.values()].join(",") });

async function post(path, parameters, body) {
  const answer = await fetch(`${path}?${new URLSearchParams(parameters)}`, {
    method: "POST",
    headers: headers(),
    body,
  });
  const text = await answer.text();
  if (!answer.ok) throw new Error(text.trim());
  return text;
}

async function attempt(what) {
  at("said").textContent = "";
  try {
    await what();
  } catch (error) {
    at("said").textContent = error.message;
  }
  await look();
}

/** Whether the rows are other ones than before. */
function fill(select, rows, chosen) {
  const words = JSON.stringify(rows);
  if (select.dataset.rows === words) return false;
  select.dataset.rows = words;
  select.replaceChildren(...rows.map(([value, label]) => new Option(label, value, false, value === chosen)));
  return true;
}

function button(label, name, act) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = label;
  made.setAttribute("aria-label", `${label} ${name}`);
  made.addEventListener("click", () => attempt(act));
  return made;
}

function slots(found) {
  at("holder").hidden = found.length === 0;
  const draw = (name, attributes, text) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.textContent = text ?? "";
    return made;
  };
  at("slots").replaceChildren(...found.flatMap(({ name, colour, is_loaded }, place) => {
    const x = 4 + place * 33;
    return [
      draw("rect", { x, y: 8, width: 29, height: 40, rx: 3, stroke: "currentColor",
        fill: is_loaded && colour !== "none" ? colour : "transparent", "stroke-dasharray": is_loaded ? "" : "3" }),
      draw("text", { x: x + 14, y: 62, "font-size": 6, "text-anchor": "middle", fill: "currentColor" }, name),
    ];
  }));
}

function show(about) {
  const { state } = about;
  const reasons = state.reasons.filter((reason) => reason !== "none").join(", ");
  const ready = state.is_stopped ? "Stopped" : "Ready";
  at("now").textContent = [state.prints ? `Job ${state.prints}` : ready, state.message, reasons].filter(Boolean).join(". ");
  at("progress").hidden = state.percent === null;
  if (state.percent !== null) at("progress").value = state.percent;
  slots(about.cartridges);
  fill(at("printer"), about.printers.map(({ name, about: words }) => [name, `${name}: ${words}`]));
  if (fill(at("which"), about.charts.map(({ name, label }) => [name, label]))) {
    about.charts.forEach((chart, place) => { at("which").options[place].dataset.look = chart.look; });
    at("look").textContent = about.charts[0].look;
  }
  fill(at("size"), about.sizes.map(({ keyword, label }) => [keyword, label]), about.loaded.size);
  fill(at("kind"), about.types.map(({ keyword, label }) => [keyword, label]), about.loaded.kind);
  const jobs = JSON.stringify(about.jobs);
  if (at("jobs").dataset.shown !== jobs) {
    at("jobs").dataset.shown = jobs;
    at("jobs").replaceChildren(...about.jobs.map((job) => {
      const line = document.createElement("li");
      const count = job.sheets ? ` (${job.done} of ${job.sheets})` : "";
      line.append(`${job.id} ${job.name}: ${job.state}${count}. ${job.message} `);
      if (job.held && job.mine) line.append(button("Release", job.name, () => post("/desk/release", { job: job.id })));
      if (!job.over && job.mine && job.lacks) {
        line.append(
          button("It is loaded now", job.name, () => post("/desk/load", job.lacks)),
          button("Print on the loaded sheet", job.name, () => post("/desk/lay", { job: job.id })),
        );
      }
      if (!job.over && job.mine) line.append(button("Cancel", job.name, () => post("/desk/cancel", { job: job.id })));
      return line;
    }));
  }
  at("ribbons").replaceChildren(...about.ribbons.map(({ ink, used_mm }) => {
    const line = document.createElement("li");
    line.textContent = `${ink}: ${(used_mm / 1000).toFixed(1)} m`;
    return line;
  }));
}

async function look() {
  try {
    show(await (await fetch("/desk.json", { headers: headers() })).json());
  } catch {
    at("now").textContent = "The server does not answer.";
  }
}

/** A document or a chart becomes a job that is held; what it takes is shown. */
async function propose(path, parameters, file) {
  at("plan-words").textContent = "Drawing…";
  at("passes").replaceChildren();
  at("preview").removeAttribute("src");
  at("plan").hidden = false;
  planned = 0;
  try {
    const { job, key } = JSON.parse(await post(path, { printer: at("printer").value, ...parameters }, file));
    remember(job, key);
    const plan = JSON.parse(await post("/desk/plan", { job }));
    planned = job;
    at("plan-words").textContent = `${plan.sheets} sheet${plan.sheets === 1 ? "" : "s"}; the first one takes these passes. ${plan.note}`;
    at("passes").replaceChildren(...plan.passes.map(({ ink, dots, ribbon_mm }) => {
      const line = document.createElement("li");
      line.textContent = `${ink}: ${dots.toLocaleString("en")} dots, about ${(ribbon_mm / 1000).toFixed(2)} m of ribbon`;
      return line;
    }));
    await picture(job);
  } catch (error) {
    at("plan").hidden = true;
    throw error;
  } finally {
    // The same file can be chosen again.
    at("file").value = "";
  }
}

/** The picture of a job, which only its owner and the keeper see. */
async function picture(job) {
  const answer = await fetch(`/desk/preview.png?job=${job}`, { headers: headers() });
  if (!answer.ok) throw new Error((await answer.text()).trim());
  URL.revokeObjectURL(at("preview").src);
  at("preview").src = URL.createObjectURL(await answer.blob());
}

async function settle(path) {
  const job = planned;
  if (job === 0) return;
  at("plan").hidden = true;
  await post(path, { job });
}

const take = (file) => propose("/desk/print", { name: file.name }, file);
at("file").addEventListener("change", () => at("file").files[0] && attempt(() => take(at("file").files[0])));
at("which").addEventListener("change", () => { at("look").textContent = at("which").selectedOptions[0].dataset.look; });
at("chart").addEventListener("submit", (event) => {
  event.preventDefault();
  attempt(() => propose("/desk/chart", { chart: at("which").value }));
});
for (const kind of ["dragover", "dragleave", "drop"]) {
  at("drop").addEventListener(kind, (event) => {
    event.preventDefault();
    at("drop").classList.toggle("over", kind === "dragover");
    const file = kind === "drop" && event.dataTransfer.files[0];
    if (file) attempt(() => take(file));
  });
}
at("go").addEventListener("click", () => attempt(() => settle("/desk/release")));
at("drop-it").addEventListener("click", () => attempt(() => settle("/desk/cancel")));
at("print").addEventListener("submit", (event) => event.preventDefault());
at("load").addEventListener("submit", (event) => {
  event.preventDefault();
  attempt(() => post("/desk/load", { size: at("size").value, kind: at("kind").value }));
});
look();
setInterval(look, 2000);
