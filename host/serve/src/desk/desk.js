// The desk: asks the server every two seconds how things are. All text is set as text, never as markup.

import { at, attempt, post, remember, state } from "./ask.js";
import * as lists from "./lists.js";
import * as ticket from "./ticket.js";

async function look() {
  try {
    lists.show(await state());
  } catch {
    at("now").textContent = "The server does not answer.";
  }
}

/** A document or a chart becomes a job that is held, and is looked at. */
async function propose(path, parameters, file) {
  ticket.close();
  at("plan-words").textContent = "Sending…";
  at("plan").hidden = false;
  try {
    const { job, key } = JSON.parse(await post(path, { printer: at("printer").value, ...parameters }, file));
    remember(job, key);
    await ticket.look(job);
  } catch (error) {
    ticket.close();
    throw error;
  } finally {
    // The same file can be chosen again.
    at("file").value = "";
  }
}

const take = (file) => attempt(() => propose("/desk/print", { name: file.name }, file));
at("file").addEventListener("change", () => at("file").files[0] && take(at("file").files[0]));
at("chart").addEventListener("click", () => attempt(() => propose("/desk/chart", { chart: at("which").value })));
at("which").addEventListener("change", look);
at("print").addEventListener("submit", (event) => event.preventDefault());
for (const kind of ["dragover", "dragleave", "drop"]) {
  at("drop").addEventListener(kind, (event) => {
    event.preventDefault();
    at("drop").classList.toggle("over", kind === "dragover");
    const file = kind === "drop" && event.dataTransfer.files[0];
    if (file) take(file);
  });
}
document.addEventListener("done", look);
look();
setInterval(look, 2000);
