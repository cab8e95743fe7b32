// How the job on the sheet is printed. Each change goes to the server, and the sheet is drawn again; what is changed meanwhile
// goes with the next one.

import { at, attempt, element, fill, post } from "./ask.js";
import * as sheet from "./sheet.js";

/** The options that everybody sees. */
const MAIN = ["FoilpressWhite", "white-passes", "MirrorPrint"];
let open = 0, page = 1, busy = false, wanted = {};
const form = at("ticket");

const time = (seconds) => (seconds < 90 ? `${seconds} s` : `${Math.round(seconds / 60)} min`);
const metres = (mm) => `${(mm / 1000).toFixed(2)} m`;

export const current = () => open;

function field(label, name, values) {
  const select = element("select", { name });
  fill(select, [["", "as the preset says"], ...values]);
  return element("label", {}, `${label} `, select);
}

function options(plan) {
  if (form.dataset.has) return;
  form.dataset.has = "all";
  const fields = plan.options.map(({ keyword, label, values }) => [keyword, field(label, keyword, values)]);
  const passes = ["1", "2", "3", "4", "5"].map((number) => [number, number]);
  fields.push(["white-passes", field("Passes of white", "white-passes", passes)]);
  fields.push(["quality", field("Quality", "quality", [["3", "draft"], ["4", "normal"], ["5", "best"]])]);
  for (const [keyword, one] of fields) at(MAIN.includes(keyword) ? "main-options" : "more-options").append(one);
}

/** A cartridge is ticked off when it is at hand. */
const ticked = () => new Set(JSON.parse(sessionStorage.getItem("ticked") ?? "[]"));
function tick(ink, is_there) {
  const all = ticked();
  if (is_there) all.add(ink); else all.delete(ink);
  sessionStorage.setItem("ticked", JSON.stringify([...all]));
}

function takes(plan) {
  const sum = (of) => plan.passes.reduce((all, pass) => all + of(pass), 0);
  const copies = Number(plan.ticket.copies), many = plan.sheets * copies;
  at("takes").textContent = `${many} sheet${many === 1 ? "" : "s"}; this one takes about ${time(sum((p) => p.seconds))} and ${metres(sum((p) => p.ribbon_mm))} of ribbon. Cartridges, in this order:`;
  const there = ticked();
  at("passes").replaceChildren(...plan.passes.map((pass) => {
    const box = element("input", { type: "checkbox", checked: there.has(pass.ink) });
    box.addEventListener("change", () => tick(pass.ink, box.checked));
    const words = ` ${pass.ink}: ${pass.dots.toLocaleString("en")} dots, about ${metres(pass.ribbon_mm)} of ribbon`;
    return element("li", {}, element("label", {}, box, " ", sheet.swatch(pass.colour), words));
  }));
}

function show(plan) {
  options(plan);
  [open, page] = [plan.job, plan.page];
  const [left, top, wide] = (plan.lies_mm ?? []).map((side) => side.toFixed(1));
  const values = { ...plan.ticket, left: left ?? "", top: top ?? "", wide: wide ?? "" };
  // What was typed meanwhile is on its way, and what is being typed stays.
  const is_old = Object.keys(wanted).length > 0;
  for (const [name, value] of Object.entries(values)) {
    const one = form.elements.namedItem(name);
    if (one && one !== document.activeElement && !is_old) one.value = value;
  }
  for (const name of ["left", "top", "wide"]) form.elements.namedItem(name).disabled = !plan.lies_mm;
  form.elements.namedItem("scaling").disabled = !plan.is_drawn;
  at("plan-words").replaceChildren(element("bdi", { textContent: plan.name }), `: ${plan.note || "as it comes"}`);
  takes(plan);
  at("plan").hidden = at("ticket-part").hidden = false;
  return sheet.show(plan, change, is_old);
}

/** Draws a job and shows it. */
export async function look(job, number = 1) {
  if (job !== open) at("plan-words").textContent = "Drawing…";
  at("plan").hidden = false;
  try {
    await show(JSON.parse(await post("/desk/plan", { job, page: number })));
  } catch (error) {
    if (job !== open) close();
    throw error;
  }
}

export function close() {
  [open, wanted] = [0, {}];
  at("plan").hidden = at("ticket-part").hidden = true;
  sheet.hide();
}

/** Changes what the job asks for. */
export function change(parameters) {
  if (open === 0) return;
  Object.assign(wanted, parameters);
  if (busy) return;
  busy = true;
  attempt(async () => {
    // Closing empties what is wanted.
    while (Object.keys(wanted).length > 0) {
      const now = wanted;
      wanted = {};
      sheet.draws();
      try {
        await post("/desk/change", { job: open, ...now });
      } finally {
        await look(open, page);
      }
    }
  }).finally(() => { busy = false; });
}

form.addEventListener("submit", (event) => event.preventDefault());
form.addEventListener("change", ({ target: { name, value } }) => {
  const [left, top, wide] = ["left", "top", "wide"].map((side) => form.elements.namedItem(side).value);
  if (["left", "top", "wide"].includes(name)) sheet.put(Number(left), Number(top), Number(wide));
  if (name === "left" || name === "top") return change({ at: `${left},${top}` });
  if (name === "scaling") {
    // What fits lies in the middle again.
    return change(value === "" ? { wide } : { scaling: value, at: "" });
  }
  change({ [name]: value });
});
at("before").addEventListener("click", () => attempt(() => look(open, page - 1)));
at("after").addEventListener("click", () => attempt(() => look(open, page + 1)));
async function settle(path) {
  const job = open;
  close();
  await post(path, { job });
}
at("go").addEventListener("click", () => attempt(() => settle("/desk/release")));
at("drop-it").addEventListener("click", () => attempt(() => settle("/desk/cancel")));
