// Results of a search: each page that has words of the query, or its section whose heading has most
// of them. A word that few pages have counts more. A result needs no word, since a question in one's
// own words has words that the answer lacks.
// Excerpts: whole sentences of the section that has most words, without code, tables and lists of
// contents.

if (typeof Search !== "undefined") {
  const LENGTH = 240; // characters of an excerpt, approximately
  const OMITTED = "nav, table, details, .toc, .contents, .live, floatbase-robot, div.cell";

  const POINTS = 10; // for all words in the text of a page, and again for all words in a heading
  const OTHER = 0.05; // of these, taken off for each further word in the heading
  const SECTION = 0.4; // fraction of the words that the heading of a section needs
  const LEAST = 0.5; // of the points of the best page, for a page to be listed
  const EXACT_TITLE = 10; // points; a title that contains the query has up to 16

  const stems = (text) => new Set(splitQuery(text.toLowerCase())
    .filter((word) => !stopwords.has(word)).map((word) => new Stemmer().stemWord(word)));

  // the site's spelling
  const parseQuery = Search._parseQuery;
  Search._parseQuery = (query) => parseQuery(query.replace(/center/gi, "centre")
    .replace(/(col|behavi)or/gi, "$1our").replace(/(\w{4,}i)s(e[sd]?|ing|ations?)\b/gi, "$1z$2"));

  const pagesWith = Search.performTermsSearch; // with all words
  const pagesOf = (word) => pagesWith(new Set([word]), new Set());
  const weightOf = (pages) => Math.log(1 + Search._index.docnames.length / pages.length);

  Search.performTermsSearch = (words) => {
    const weights = new Map(), found = new Map();
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
    const points = ({words, heading}) => POINTS * (words / all + heading);
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

  // sentences of a part of a page; a paragraph that is wholly in italics lists words to search for
  const sentencesOf = (part, isWhole) =>
    [...part.querySelectorAll("p, li:not(:has(p)), dd:not(:has(p))")]
      .filter((paragraph) => isWhole || paragraph.closest("section, article") === part)
      .filter((paragraph) => !paragraph.closest(OMITTED))
      .filter((paragraph) => paragraph.querySelector("em")?.textContent !== paragraph.textContent)
      .flatMap((paragraph) => paragraph.textContent.trim().split(/(?<=[.?!])\s+(?=\p{Lu})/u));

  Search.makeSearchSummary = (html, keywords, anchor) => {
    const page = new DOMParser().parseFromString(html, "text/html");
    const main = page.querySelector("article"); // without the buttons above it
    const place = page.getElementById(anchor?.slice(1) ?? "")?.closest("section, dl.py");
    const weights = [...keywords].map((word) => [word.toLowerCase(), weightOf(pagesOf(word))]);
    const weigh = (text, without = "") => weights
      .filter(([word]) => text.toLowerCase().includes(word) && !without.includes(word))
      .reduce((sum, [, weight]) => sum + weight, 0);
    const parts = place ? [place] : [main, ...main.querySelectorAll("section")];
    const most = (list, value) => list.reduce(
      (best, each) => value(each) > value(best) ? each : best, list[0]);
    const headingOf = (part) =>
      part.querySelector(":scope > :is(h1, h2, h3, h4)")?.firstChild?.textContent ?? "";
    const part = most(parts, (each) => weigh(headingOf(each) + sentencesOf(each)));
    const sentences = sentencesOf(part, place);
    const heading = headingOf(part).toLowerCase();
    const first = most(sentences, (sentence) => weigh(sentence, heading));
    let text = "";
    for (const sentence of sentences.slice(sentences.indexOf(first))) {
      if (text.length + sentence.length > LENGTH && text) break;
      text = `${text} ${sentence}`.trim();
    }
    const summary = document.createElement("p");
    summary.className = "context";
    summary.textContent = text;
    return summary;
  };
}
