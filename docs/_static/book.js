// Buttons that copy code, and a filter of the ledger; the pages are complete without them.
document.addEventListener("DOMContentLoaded", () => {
  for (const block of document.querySelectorAll("div.highlight")) {
    const button = document.createElement("button");
    button.className = "copy";
    button.textContent = "Copy";
    button.addEventListener("click", async () => {
      const lines = block.querySelector("pre").textContent.trimEnd().split("\n");
      // Of an example with prompts, the code without what it prints.
      const code = lines.filter((line) => /^(>>>|\.\.\.)( |$)/.test(line));
      const text = code.length ? code.map((line) => line.slice(4)) : lines;
      await navigator.clipboard.writeText(text.join("\n") + "\n");
      button.textContent = "Copied";
      setTimeout(() => (button.textContent = "Copy"), 1500);
    });
    block.append(button);
  }

  const rows = [...document.querySelectorAll("table.claims tbody tr")];
  if (rows.length) {
    const field = document.createElement("input");
    field.type = "search";
    field.className = "filter";
    field.placeholder = "Filter: words of a claim, such as wrong cable";
    field.setAttribute("aria-label", "Filter the claims");
    const count = document.createElement("output");
    const texts = rows.map((row) => row.textContent.toLowerCase());
    field.addEventListener("input", () => {
      const words = field.value.toLowerCase().split(/\s+/);
      rows.forEach((row, n) => (row.hidden = !words.every((word) => texts[n].includes(word))));
      count.textContent = `${rows.filter((row) => !row.hidden).length} of ${rows.length} claims`;
    });
    document.querySelector("h2").before(field, count);
  }
});
