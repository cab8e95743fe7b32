// The slider between the photograph and what it is compared with. Without this script the pictures stand one above the other.
"use strict";

for (const figure of document.querySelectorAll("figure.pair")) {
  const over = figure.querySelector(".over");
  const slider = figure.querySelector("input");
  const views = figure.querySelectorAll("img.view");
  const choice = figure.querySelector("select");
  const split = () => {
    over.style.clipPath = `inset(0 ${100 - slider.value}% 0 0)`;
    figure.style.setProperty("--split", `${slider.value}%`);
  };
  const choose = () => views.forEach((view, i) => { view.hidden = i !== choice.selectedIndex; });
  const drag = (event) => {
    if (event.buttons !== 1) return;
    const box = over.getBoundingClientRect();
    slider.value = 100 * (event.clientX - box.left) / box.width;
    split();
  };
  const stage = figure.querySelector(".stage");
  stage.addEventListener("pointerdown", (event) => { event.preventDefault(); drag(event); });
  stage.addEventListener("pointermove", drag);
  slider.addEventListener("input", split);
  choice.addEventListener("change", choose);
  figure.classList.add("live");
  split();
  choose();
}
