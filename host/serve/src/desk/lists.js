// What is going on: the printer, its cartridges, the jobs and those before, and a word when somebody is wanted.

import { at, attempt, button, element, fill, picture, post, remember } from "./ask.js";
import * as ticket from "./ticket.js";

/** Sets what a part holds if it is another thing than before. */
function set(part, what, make) {
  const words = JSON.stringify(what);
  if (part.dataset.shown === words) return;
  part.dataset.shown = words;
  part.replaceChildren(...make());
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

function lineOf(job) {
  const line = element("li");
  const count = job.held ? "" : job.sheets ? ` (${job.done} of ${job.sheets})` : job.done ? ` (${job.done} so far)` : "";
  line.append(`${job.id} `, element("bdi", { textContent: job.name }), `: ${job.state}${count}. ${job.message} `);
  const add = (label, act) => line.append(button(label, job.name, act), " ");
  if (!job.mine) return line;
  if (job.stopped) add("Go on", () => post("/desk/release", { job: job.id }));
  if (!job.over && !job.stopped && (job.held || job.waits)) add("Look", () => ticket.look(job.id));
  if (!job.over && job.lacks) {
    add("It is loaded now", () => post("/desk/load", job.lacks));
    add("Print on the loaded sheet", () => post("/desk/lay", { job: job.id }));
  }
  if (!job.over) add("Cancel", () => post("/desk/cancel", { job: job.id }));
  if (job.again) {
    add("Print again", async () => {
      const made = JSON.parse(await post("/desk/again", { job: job.id }));
      remember(made.job, made.key);
      await ticket.look(made.job);
    });
  }
  return line;
}

/** Jobs that are over, each with its picture once they are in sight. */
function before(jobs) {
  return jobs.map((one) => {
    const line = lineOf(one);
    if (one.again && at("history").open) {
      const image = element("img", { alt: "" });
      line.prepend(image);
      picture("/desk/picture.png", { job: one.id }).then((url) => { image.src = url; }, () => image.remove());
    }
    return line;
  });
}

let told = "";
/** Says it where the page is not in sight, once. */
function tell(about) {
  const { is_stopped, wants_cartridge, reasons, message } = about.state;
  const wants = is_stopped || wants_cartridge || reasons.length > 0 ? message || "The printer waits." : "";
  document.title = `${wants ? "● " : ""}Foilpress: the desk`;
  const can = "Notification" in window;
  at("notify").hidden = !(can && Notification.permission === "default");
  if (can && wants && wants !== told && Notification.permission === "granted") {
    new Notification("ALPS MD-5500", { body: wants, icon: "/icon.png", tag: "foilpress" });
  }
  told = wants;
}

let was = null;
/** The sheet that is loaded, unless somebody is choosing another one. */
function loaded(about) {
  fill(at("size"), about.sizes.map(({ keyword, label }) => [keyword, label]));
  fill(at("kind"), about.types.map(({ keyword, label }) => [keyword, label]));
  if (was?.revision === about.loaded.revision) return;
  was = about.loaded;
  [at("size").value, at("kind").value] = [was.size, was.kind];
}

export function show(about) {
  const { state } = about;
  const drawing = about.drawing && about.drawing.sheets > 0 ? `Drawing: ${about.drawing.sheets} sheets so far.` : "";
  at("now").textContent = state.message || drawing || (state.prints ? `Job ${state.prints} is printed.` : "Nothing is printed.");
  at("progress").hidden = state.percent === null;
  if (state.percent !== null) at("progress").value = state.percent;
  const waits = about.await_switch;
  at("switched").hidden = waits === 0;
  at("switched").textContent = `The printer was switched off and on (${waits} job${waits === 1 ? " waits" : "s wait"} for that)`;
  tell(about);
  at("todo").hidden = at("switched").hidden && at("notify").hidden;
  at("aside").hidden = about.aside.length === 0;
  set(at("aside"), about.aside, () => about.aside.map((text) => element("li", { textContent: text })));
  slots(about.cartridges);
  fill(at("printer"), about.printers.map(({ name, about: words }) => [name, name === words ? name : `${name}: ${words}`]));
  fill(at("which"), about.charts.map(({ name, label }) => [name, label]));
  at("look").textContent = about.charts.find(({ name }) => name === at("which").value)?.look ?? "";
  loaded(about);
  const [over, open] = [about.jobs.filter((one) => one.over), about.jobs.filter((one) => !one.over)];
  at("jobs-part").hidden = about.jobs.length === 0;
  set(at("jobs"), open, () => open.map(lineOf));
  at("history").hidden = over.length === 0;
  set(at("over"), [over, at("history").open], () => before(over));
  // What is printed or cancelled elsewhere is closed here, too.
  const current = about.jobs.find(({ id }) => id === ticket.current());
  if (current && !(current.held || current.waits)) ticket.close();
  at("ribbons-part").hidden = about.ribbons.length + about.cartridges.length === 0;
  set(at("ribbons"), about.ribbons, () => about.ribbons.map(({ ink, used_mm }) =>
    element("li", { textContent: `${ink}: ${(used_mm / 1000).toFixed(1)} m used` })));
  at("code-part").hidden = about.is_keeper && at("code").value === "";
}

at("switched").addEventListener("click", () => attempt(() => post("/desk/switched", {})));
at("notify").addEventListener("click", () => attempt(() => Notification.requestPermission()));
at("history").addEventListener("toggle", () => document.dispatchEvent(new Event("done")));
at("load").addEventListener("submit", (event) => {
  event.preventDefault();
  const [size, kind] = [at("size").value, at("kind").value], changes = { revision: was.revision };
  if (size !== was.size) changes.size = size;
  if (kind !== was.kind) changes.kind = kind;
  if (Object.keys(changes).length < 2) return;
  attempt(async () => {
    try {
      await post("/desk/load", changes);
    } finally {
      // What is true now is shown, whoever said it.
      was = null;
    }
  });
});
