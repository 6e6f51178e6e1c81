// Search results: what explains a word comes before the reference of functions.
var Scorer = {
  score: ([page, title, anchor, description, score]) =>
    page.startsWith("notebooks/lessons/") ? 2 * score + 5
      : page.startsWith("api/") || page === "CHANGELOG" ? score / 4 : score,
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
