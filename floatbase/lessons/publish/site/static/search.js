// Results of a search: each page with words of the query, or its section whose heading has most of
// them. Words that few pages have count more. A result need not have all words, because a learner's
// question has words that its answer lacks.
// Excerpts: whole sentences of the section that has most words, without code, tables and lists of
// contents. The result of a page leads to this section.

if (typeof Search !== "undefined") {
  const LENGTH = 240; // characters of an excerpt, approximately
  const OMITTED = "nav, table, details, .toc, .contents, .live, floatbase-robot, div.cell";

  const POINTS = 10; // for all words in the text of a page, and again for all words in a heading
  const OTHER = 0.05; // of these, taken off for each further word in the heading
  const SECTION = 0.4; // fraction of the words that the heading of a section needs
  const LEAST = 0.5; // of the points of the best page, for a page to be listed
  const EXACT_TITLE = 10; // points; a title that contains the query has up to 16

  const SPELLED = {τ: " tau ", μ: " mu ", λ: " lambda ", ᵀ: " t "};
  const stems = (text) => new Set(splitQuery(text.toLowerCase().replace(/[τμλᵀ]/g, (c) => SPELLED[c]))
    .filter((word) => !stopwords.has(word)).map((word) => new Stemmer().stemWord(word)));

  // the site's spelling
  const parseQuery = Search._parseQuery;
  Search._parseQuery = (query) => parseQuery(query.replace(/center(?=ed|ing)/gi, "centr")
    .replace(/center/gi, "centre").replace(/(col|behavi)or/gi, "$1our")
    .replace(/(\w{4,}(?<![cvw]|pr|ert|prom|prem)i)s(e[sd]?|ing|ations?)\b/gi, "$1z$2"));

  const pagesWith = Search.performTermsSearch; // with all words
  const pagesOf = (word) => pagesWith(new Set([word]), new Set());
  const weightOf = (pages) => Math.log(1 + Search._index.docnames.length / pages.length);

  // different words of each page, as a fraction of the mean over all pages
  const lengths = () => {
    const {terms, docnames} = Search._index, counts = docnames.map(() => 0);
    for (const pages of Object.values(terms)) for (const page of [pages].flat()) counts[page] += 1;
    const mean = counts.reduce((sum, count) => sum + count, 0) / counts.length;
    return new Map(docnames.map((name, page) => [name, counts[page] / mean]));
  };

  Search.performTermsSearch = (words) => {
    const weights = new Map(), found = new Map(), length = lengths();
    for (const word of words) {
      const pages = pagesOf(word);
      if (pages.length) weights.set(word, weightOf(pages));
      for (const page of pages) {
        if (!found.has(page[0])) found.set(page[0], {page, words: 0, heading: 0, section: []});
        found.get(page[0]).words += weights.get(word);
      }
    }
    const all = [...weights.values()].reduce((sum, weight) => sum + weight, 0);
    for (const [title, places] of Object.entries(Search._index.alltitles)) {
      const inTitle = stems(title), known = [...inTitle].filter((word) => weights.has(word));
      const part = known.reduce((sum, word) => sum + weights.get(word), 0) / all
        - OTHER * (inTitle.size - known.length);
      for (const [file, id] of places) {
        const best = found.get(Search._index.docnames[file]);
        if (best && part > best.heading)
          Object.assign(best, {heading: part, section: id && part > SECTION ? [title, id] : []});
      }
    }
    const points = ({page, words, heading}) =>
      POINTS * (words / all * Math.min(1, 3 / (2 + length.get(page[0]))) + heading);
    const most = Math.max(...[...found.values()].map(points));
    return [...found.values()].filter((each) => points(each) >= LEAST * most).map((each) => {
      const [docname, title, , , , file, kind] = each.page, [heading, id] = each.section;
      return [docname, heading ? `${title} > ${heading}` : title, heading ? `#${id}` : "", null,
              points(each), file, kind];
    });
  };

  Scorer.score = ([, title, , , score, , kind]) => {
    const query = new URLSearchParams(location.search).get("q") ?? "";
    const last = title.split(" > ").at(-1);
    const isExact = kind === SearchResultKind.title
      && last.toLowerCase() === query.trim().toLowerCase();
    return score + (isExact ? EXACT_TITLE : 0);
  };

  // whether a paragraph only lists links, or words to search for, which are in italics
  const isList = (paragraph) => [...paragraph.querySelectorAll("a, em")]
    .reduce((sum, one) => sum + one.textContent.length, 0) > paragraph.textContent.length / 2;

  Search.makeSearchSummary = (html, keywords, anchor) => {
    const page = new DOMParser().parseFromString(html, "text/html");
    const main = page.querySelector("article"); // without the buttons above it
    const place = page.getElementById(anchor?.slice(1) ?? "")?.closest("section, dl.py");
    const weights = [...keywords].map((word) => [word.toLowerCase(), weightOf(pagesOf(word))]);
    const weigh = (text, known = "") => weights
      .filter(([word]) => text.toLowerCase().includes(word) && !known.toLowerCase().includes(word))
      .reduce((sum, [, weight]) => sum + weight, 0);
    const heaviest = (list, textOf, known) => list.reduce(
      (best, one) => weigh(textOf(one), known) > weigh(textOf(best), known) ? one : best, list[0]);
    const headingOf = (part) =>
      part.querySelector(":scope > :is(h2, h3, h4)")?.firstChild.textContent ?? "";
    const paragraphsOf = (part) =>
      [...part.querySelectorAll("p, li:not(:has(p)), dd:not(:has(p))")]
        .filter((one) => part === place || one.closest("section, article") === part);

    const part = place ?? heaviest([main, ...main.querySelectorAll("section")],
      (one) => [headingOf(one), ...paragraphsOf(one).map((each) => each.textContent)].join(" "));
    const heading = headingOf(part);
    const sentences = paragraphsOf(part).filter((one) => !one.closest(OMITTED) && !isList(one))
      .flatMap((one) => one.textContent.trim().split(/(?<=[.?!])\s+(?=\p{Lu})/u));
    const first = heaviest(sentences, (sentence) => sentence, heading);
    let text = "";
    for (const sentence of sentences.slice(sentences.indexOf(first))) {
      if (text.length + sentence.length > LENGTH && text) break;
      text = `${text} ${sentence}`.trim();
    }
    const summary = document.createElement("p");
    summary.className = "context";
    summary.textContent = text;
    if (!place && heading) queueMicrotask(() => {
      const link = summary.parentElement?.querySelector("a");
      link?.append(` > ${heading}`);
      if (link) link.hash = part.id;
    });
    return summary;
  };
}
