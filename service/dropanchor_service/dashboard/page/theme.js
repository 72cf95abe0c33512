/** Light or dark colours: those of the system until the user chooses others. */

import { t } from "../i18n/language.js";

const KEY = "dropanchor-theme";

/** @param {HTMLButtonElement} button @param {() => void} changed */
export function installTheme(button, changed) {
  const system = matchMedia("(prefers-color-scheme: dark)");
  const apply = () => {
    const theme = localStorage.getItem(KEY) ?? (system.matches ? "dark" : "light");
    document.documentElement.dataset.theme = theme;
    button.title = t(theme === "dark" ? "theme.light" : "theme.dark");
    button.setAttribute("aria-label", button.title);
    changed();
  };
  button.addEventListener("click", () => {
    localStorage.setItem(KEY, document.documentElement.dataset.theme === "dark" ? "light" : "dark");
    apply();
  });
  system.addEventListener("change", apply);
  apply();
}
