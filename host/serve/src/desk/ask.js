// Requests to the server. The keys that it gave for what this browser uploaded show whose jobs are ours.

const MOST_KEYS = 50;
const keys = new Map(JSON.parse(localStorage.getItem("keys") ?? "[]"));

export const at = (id) => document.getElementById(id);

at("code").value = sessionStorage.getItem("code") ?? "";
at("code").addEventListener("change", () => sessionStorage.setItem("code", at("code").value));

export function remember(job, key) {
  keys.delete(job);
  keys.set(job, key);
  for (const oldest of [...keys.keys()].slice(0, -MOST_KEYS)) keys.delete(oldest);
  localStorage.setItem("keys", JSON.stringify([...keys]));
}

const headers = () => ({ "x-foilpress-code": at("code").value, "x-foilpress-keys": [...keys.values()].join(",") });

async function answered(path, parameters, more) {
  const answer = await fetch(`${path}?${new URLSearchParams(parameters)}`, { headers: headers(), ...more });
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return answer;
}

export const post = async (path, parameters, body) =>
  (await answered(path, parameters, { method: "POST", body })).text();
export const state = async () => (await answered("/desk.json", {})).json();

/** The address of a picture that only its owner and the keeper see; to be revoked. */
export const picture = async (path, parameters) =>
  URL.createObjectURL(await (await answered(path, parameters, {})).blob());

/** Does something and tells what is the matter with it. */
export async function attempt(what) {
  at("said").textContent = "";
  try {
    await what();
  } catch (error) {
    at("said").textContent = error.message;
  }
  document.dispatchEvent(new Event("done"));
}

/** An element with words and what it does. Words are never markup. */
export function element(name, properties = {}, ...inside) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...inside);
  return made;
}

/** A button; `about` says for which thing, to those who do not see it beside. */
export function button(label, about, act) {
  const made = element("button", { type: "button", textContent: label });
  made.setAttribute("aria-label", `${label} ${about}`);
  made.addEventListener("click", () => attempt(act));
  return made;
}

/** Fills a list of choices unless it has these already, and chooses one if it has. */
export function fill(select, rows, chosen) {
  const words = JSON.stringify(rows);
  if (select.dataset.rows !== words) {
    select.dataset.rows = words;
    select.replaceChildren(...rows.map(([value, label]) => new Option(label, value)));
  }
  if (chosen !== undefined) select.value = chosen;
}
