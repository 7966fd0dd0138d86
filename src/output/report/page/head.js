// The head of the page: the drive and its figures, notices; and the tabs, light and dark, folding the view.

/** The units of coordinates in words. */
function unitWords() {
  const [plan, height] = UNITS;
  return plan === height ? plan : `${plan}, heights in ${height}`;
}

/** The processed part of the axis in words; null where it is the whole axis. */
function sectionWords({ section }) {
  return section ? `${shown(section.from_m, 0)} to ${shown(section.to_m, 0)} m of ${shown(section.length_m, 0)} m` : null;
}

/** The length of an axis in words, the same wherever it is named. */
function lengthWords(metres) { return metres < 1000 ? `${shown(metres, 0)} m` : `${shown(metres / 1000, 2)} km`; }

function fillHead(page, run) {
  const { result, axis } = run, section = sectionWords(result);
  $("title").textContent = $("title").title = page.title;
  const coordinates = UNITS.every((unit) => unit === "m") ? null : `coordinates in ${unitWords()}`;
  const words = [page.files, section && `chainage ${section}`, run.crs.description && `coordinate system ${run.crs.description}`, coordinates, run.program];
  $("subtitle").textContent = $("subtitle").title = words.filter(Boolean).join(" · ");
  const call = resumed(result).before ? ", last call" : "";
  const figures = [
    section ? ["Chainage", section, ""] : ["Length", lengthWords(axis.length_m), ""], ["Points", shown(result.points), ""], [capital(THINGS.many), shown(result.objects), ""],
    [`Time${call}`, seconds(result.seconds), ""], [`Memory${call}`, result.peak_resident_bytes ? mebibytes(result.peak_resident_bytes) : "", "extra"],
  ];
  $("figures").replaceChildren(...figures.filter(([, value]) => value).map(([name, value, kind]) => el("div", { class: kind || null }, el("dt", {}, name), el("dd", {}, value))));
  for (const node of document.querySelectorAll("[data-thing]")) node.textContent = node.dataset.thing === "Many" ? capital(THINGS.many) : THINGS[node.dataset.thing];
}

/** A line below the head: `act` leads to more about it; the cross closes it. */
function notice(words, act) {
  const what = act ? el("button", { type: "button", class: "what", onclick: act }, ...words) : el("p", { class: "what" }, ...words);
  const node = el("div", { class: "notice" }, what, el("button", { type: "button", class: "icon", "aria-label": "Close the notice", onclick: () => node.remove() }, "×"));
  $("notices").append(node);
}

/** Binds the tabs, and returns a function that shows the one of a panel. */
function bindTabs() {
  const tabs = [...$("tabs").children];
  const show = (tab) => {
    for (const other of tabs) {
      other.setAttribute("aria-selected", String(other === tab));
      other.tabIndex = other === tab ? 0 : -1;
      $(other.getAttribute("aria-controls")).hidden = other !== tab;
    }
  };
  tabs.forEach((tab, at) => {
    tab.addEventListener("click", () => show(tab));
    tab.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!by) return;
      const next = tabs[(at + by + tabs.length) % tabs.length];
      show(next);
      next.focus();
    });
  });
  show(tabs[0]);
  return show;
}

/** Binds the link to the table. Under another tab the table is hidden, and what is hidden takes no focus: `show` it first. */
function bindSkip(show) {
  document.querySelector("a.skip").addEventListener("click", (event) => {
    event.preventDefault();
    show();
    $("table-panel").focus();
    $("table-panel").scrollIntoView();
  });
}

/**
 * Binds the button for light and dark, and lets printed pages be light. `changed` gets the theme: its name and colours
 * (shares of red, green, blue).
 */
function bindTheme(changed) {
  const system = matchMedia("(prefers-color-scheme: dark)");
  let isDark = system.matches, isPrinting = false;
  const apply = (dark) => {
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    const style = getComputedStyle(document.documentElement);
    const part = (name) => rgb(style.getPropertyValue(name).trim()).map((value) => value / 255);
    changed({ name: dark ? "dark" : "light", sky: part("--sky"), haze: part("--haze"), accent: part("--accent") });
  };
  const choose = (dark) => apply((isDark = dark));
  apply(isDark);
  // A browser may print as a light system does. That is no choice.
  system.addEventListener("change", (event) => { if (!isPrinting) choose(event.matches); });
  $("theme").addEventListener("click", () => choose(!isDark));
  addEventListener("beforeprint", () => { isPrinting = true; apply(false); });
  addEventListener("afterprint", () => { isPrinting = false; apply(isDark); });
}

/** Lets the view and the plan be folded away, where they would leave a phone little room for the table. */
function bindFold() {
  const stage = document.querySelector(".stage");
  const fold = (folded) => {
    stage.classList.toggle("folded", folded);
    $("fold").setAttribute("aria-expanded", String(!folded));
    $("fold").textContent = folded ? "Show view" : "Hide view";
  };
  $("fold").addEventListener("click", () => fold(!stage.classList.contains("folded")));
  // The table fills what the stage leaves of the window, so that its head stays in sight.
  new ResizeObserver(() => document.documentElement.style.setProperty("--stage", `${stage.offsetHeight}px`)).observe(stage);
  return fold;
}
