// Make every slide fit, with the fonts of this machine: figures take the room that is left, and
// what is too tall goes on below. Runs before reveal.js, which then finds slides that fit.
"use strict";

const fit = (() => {
  // Of 768, with the slide's margin above; the strip below holds the arrows and the number.
  const ROOM = 690;
  const WIDTH = 1024;
  // Sizes of a figure, times the stored one. Below LEAST it is better on a slide with less text,
  // but a figure of size FEW is better than a few lines on a slide of their own.
  const LEAST = 1.1, MOST = 1.5, FEW = 0.85, ANY = 0.3;
  const FEW_LINES = 170;
  // Sizes of code and tables, times that of slides.css, with the least size of a figure beside
  // them: they grow where there is room, and shrink where there is nothing else to shrink.
  const STEPS = [1.2, 1.15, 1.1, 1.05, 1].map((scale) => [scale, LEAST])
    .concat([1, 0.95, 0.9, 0.85, 0.8].map((scale) => [scale, ANY]));
  const SIZE = 18, SMALLEST = 14.4;
  // Sizes of text on a slide without a figure; slides.css has the last one.
  const TEXT = [32, 30, 28, 26, 24];
  const BLOCKS =
    ".jp-MarkdownCell .jp-MarkdownOutput > *, .jp-CodeMirrorEditor, .jp-OutputArea-child";

  const isFigure = (block) => block.querySelector("img") !== null;
  const isEmphatic = (block) => block.tagName === "P" && block.firstChild.nodeName === "EM";
  const isHeading = (block) => block.matches("h1, h2, h3") ||
    block.textContent === block.querySelector(":scope > strong")?.textContent;

  /** Leave the blocks of a slide only; each knows whether it begins a cell, or is a caption.
      The speaker's notes become an attribute, which every slide that continues this one gets. */
  function flatten(slide) {
    const blocks = [];
    const notes = slide.querySelector("aside.notes");
    slide.dataset.notes = notes?.querySelector(".jp-MarkdownOutput").innerHTML.trim() ?? "";
    notes?.remove();
    for (const cell of slide.querySelectorAll(".jp-Cell")) {
      cell.querySelectorAll(BLOCKS).forEach((block, k) => {
        const above = blocks.at(-1);
        block.classList.toggle("begins-cell", k === 0);
        block.classList.toggle("caption", Boolean(above && isFigure(above) && isEmphatic(block)));
        blocks.push(block);
      });
    }
    slide.replaceChildren(...blocks);
  }

  /** Whether a slide may end between two blocks. */
  function mayBreak(above, below) {
    return !isHeading(above) && !above.textContent.trim().endsWith(":") &&
      !below.matches(".caption, details");
  }

  /** Give figures the room that the text leaves, within bounds; return whether all fits. */
  function fits(slide, least) {
    const images = [...slide.querySelectorAll("img")];
    const resize = (scale) => images.forEach((image) => {
      image.style.width = `${Math.min(scale * image.getAttribute("width"), WIDTH)}px`;
    });
    let [low, high] = [least, MOST];
    for (let k = 0; images.length && k < 8; k++) {
      const scale = (low + high) / 2;
      resize(scale);
      [low, high] = slide.offsetHeight <= ROOM ? [scale, high] : [low, scale];
    }
    resize(low);
    return slide.offsetHeight <= ROOM && slide.scrollWidth <= WIDTH;
  }

  /** Choose the size of code, tables and figures of a slide that is broken no further, and let
      text take the room of a figure where there is none. */
  function settle(slide) {
    for (const [scale, least] of STEPS) {
      slide.style.setProperty("--scale", scale);
      if (fits(slide, least)) break;
    }
    if (slide.querySelector("img")) return;
    for (const size of TEXT) {
      slide.style.fontSize = `${size}px`;
      if (fits(slide, ANY)) return;
    }
  }

  /** Return before which block to break a slide that is too tall, or undefined for nowhere:
      as far down as can be, but rather between cells, and not so that a few lines are left. */
  function placeToBreak(slide, blocks) {
    const show = (from, to) => blocks.forEach((block, k) => { block.hidden = k < from || k >= to; });
    const places = blocks.flatMap((_, k) => (k && mayBreak(blocks[k - 1], blocks[k]) ? [k] : []));
    const between = places.filter((k) => blocks[k].matches(".begins-cell"));
    const wanted = [...between.reverse(), ...places.slice().reverse()];
    const good = wanted.filter((k) => { show(0, k); return fits(slide, LEAST); });
    const best = good.find((k) => { show(k, Infinity); return slide.offsetHeight > FEW_LINES; });
    show(0, Infinity);
    return best ?? (fits(slide, FEW) ? undefined : good[0] ?? places[0]);
  }

  /** Fit a slide, with what is too tall on new slides below it. */
  function paginate(slide) {
    if (!fits(slide, LEAST)) {
      const blocks = [...slide.children];
      const place = placeToBreak(slide, blocks);
      if (place !== undefined) {
        const rest = slide.cloneNode(false);
        rest.append(...blocks.slice(place));
        slide.after(rest);
        paginate(rest);
      }
    }
    settle(slide);
  }

  /** Let no line of code or of a table be broken, unless it would become too small to read. */
  function widen(block, smallest) {
    block.style.cssText = "white-space: pre; width: max-content";
    const widest = (SIZE * WIDTH) / block.offsetWidth;
    block.style.cssText = `--widest: ${Math.max(widest - 0.05, smallest)}px`;
  }

  return () => {
    const slides = document.querySelector(".reveal .slides");
    slides.classList.add("measured");
    for (const slide of slides.querySelectorAll("section > section")) {
      flatten(slide);
      const answers = slide.querySelectorAll("details");
      answers.forEach((answer) => { answer.open = true; });
      slide.querySelectorAll("pre").forEach((code) => widen(code, SMALLEST));
      slide.querySelectorAll("table").forEach((table) => widen(table, SIZE));
      paginate(slide);
      answers.forEach((answer) => { answer.open = false; });
    }
    slides.classList.remove("measured");
  };
})();
