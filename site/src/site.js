// Search over titles, headings and fields. Without scripts, the site works without the search.
"use strict";

const root = document.documentElement.dataset.root;
const box = document.getElementById("search");
const found = document.getElementById("found");
const wide = window.matchMedia("(min-width: 60rem)");
const menu = document.querySelector(".menu");

// With scripts, the contents are always open beside a wide page.
document.documentElement.classList.add("scripts");
const follow = () => { menu.open = wide.matches; };
wide.addEventListener("change", follow);
follow();
document.querySelector('nav [aria-current="page"]')?.scrollIntoView({ block: "nearest" });
window.scrollTo(0, window.scrollY);

box.parentElement.hidden = false;

let loading = null;
function load() {
  loading ??= new Promise((done) => {
    const script = document.createElement("script");
    script.src = `${root}search.js`;
    script.onload = done;
    document.head.append(script);
  });
  return loading;
}

async function search() {
  const words = box.value.toLowerCase().split(/\s+/).filter(Boolean);
  await load();
  const hits = [];
  for (const [title, address, place, meaning] of words.length ? window.papsynthPages : []) {
    const low = title.toLowerCase();
    const all = `${low} ${place} ${meaning}`.toLowerCase();
    if (words.every((word) => all.includes(word))) {
      const rank = low === words.join(" ") ? 0 : low.startsWith(words[0]) ? 1 : low.includes(words[0]) ? 2 : 3;
      hits.push({ title, address, place, rank });
    }
  }
  hits.sort((a, b) => a.rank - b.rank || a.title.length - b.title.length);
  found.replaceChildren(...hits.slice(0, 20).map(({ title, address, place }) => {
    const item = document.createElement("li");
    const link = document.createElement("a");
    link.href = root + address;
    link.textContent = title;
    const small = document.createElement("small");
    small.textContent = place;
    link.append(" ", small);
    item.append(link);
    return item;
  }));
  if (words.length && !hits.length) {
    const item = document.createElement("li");
    item.textContent = "No results";
    found.append(item);
  }
  found.hidden = !words.length;
}

box.addEventListener("focus", load, { once: true });
box.addEventListener("input", search);
found.addEventListener("click", () => { found.hidden = true; });

document.addEventListener("keydown", (event) => {
  const links = [...found.querySelectorAll("a")];
  const at = links.indexOf(document.activeElement);
  const inSearch = document.activeElement === box || at >= 0;
  if (event.key === "/" && !inSearch && !event.ctrlKey && !event.metaKey && !event.altKey) {
    event.preventDefault();
    box.focus();
  } else if (event.key === "Escape" && inSearch) {
    found.hidden = true;
    box.focus();
  } else if (inSearch && !found.hidden && (event.key === "ArrowDown" || event.key === "ArrowUp")) {
    event.preventDefault();
    (links[at + (event.key === "ArrowDown" ? 1 : -1)] ?? box).focus();
  } else if (event.key === "Enter" && document.activeElement === box && links.length) {
    links[0].click();
  }
});
document.addEventListener("click", (event) => {
  if (!event.target.closest(".search")) found.hidden = true;
});
