// What the static parts of the page offer on top of being read: colours, copies, the JSON as a file.
"use strict";

/** The element of an id. */
const byId = (id) => document.getElementById(id);

/** The data of a script element. */
const dataOf = (id) => JSON.parse(byId(id).textContent);

document.documentElement.classList.add("scripted");

/** Called after the colours changed. */
const themeListeners = [];
const isDark = () => {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
};

function setUpTheme() {
  const button = byId("theme");
  const say = () => {
    button.textContent = isDark() ? "Light colours" : "Dark colours";
    themeListeners.forEach((listener) => listener());
  };
  button.addEventListener("click", () => {
    document.documentElement.dataset.theme = isDark() ? "light" : "dark";
    say();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", say);
  say();
}

/** Copy a text, also where the browser gives a file no clipboard. */
async function copyText(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    const done = document.execCommand("copy");
    area.remove();
    return done;
  }
}

function setUpCopies() {
  for (const button of document.querySelectorAll("button.copy")) {
    button.addEventListener("click", async () => {
      const done = await copyText(button.previousElementSibling.textContent);
      if (!done) getSelection().selectAllChildren(button.previousElementSibling);
      button.textContent = done ? "Copied" : "Selected: Ctrl+C";
      setTimeout(() => { button.textContent = "Copy"; }, 2000);
    });
  }
}

function saveJson() {
  const text = JSON.stringify(dataOf("result"), null, 2) + "\n";
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  link.download = "result.json";
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

setUpTheme();
setUpCopies();
byId("print").addEventListener("click", () => window.print());
byId("save-json").addEventListener("click", saveJson);
