// Order of search results: a page or a section whose whole title is the query comes first, then
// pages whose title and headings have many words of the query.
// Excerpts of search results: whole sentences, starting at the first one with the keywords, without
// code, tables and lists of contents.

if (typeof Search !== "undefined") {
  const LENGTH = 240; // characters, approximately
  const OMITTED = "nav, table, details, .toc, .contents, .live, floatbase-robot, div.cell";

  const EXACT_TITLE = 10; // points; a word in a title has 15

  const HEADINGS = 10; // points for all words of the query

  const stem = (text) => (text.toLowerCase().match(/\p{L}+/gu) ?? [])
    .filter((word) => !stopwords.has(word)).map((word) => new Stemmer().stemWord(word));

  // which part of the words of a query the title and the headings of a page have
  const partInHeadings = (query, docname) => {
    const {alltitles, docnames} = Search._index;
    const titles = Object.entries(alltitles)
      .filter(([, places]) => places.some(([page]) => docnames[page] === docname));
    const known = new Set(titles.flatMap(([title]) => stem(title))), words = stem(query);
    return words.filter((word) => known.has(word)).length / Math.max(1, words.length);
  };

  Scorer.score = ([docname, title, , , score, , kind]) => {
    const query = new URLSearchParams(location.search).get("q") ?? "";
    const last = title.split(" > ").at(-1);
    const isExact = kind === SearchResultKind.title
      && last.toLowerCase() === query.trim().toLowerCase();
    return score + (isExact ? EXACT_TITLE : 0) + HEADINGS * partInHeadings(query, docname);
  };

  Search.makeSearchSummary = (html, keywords, anchor) => {
    const page = new DOMParser().parseFromString(html, "text/html");
    const main = page.querySelector("article"); // without the buttons above it
    const place = page.getElementById(anchor?.slice(1) ?? "");
    const part = place?.closest("section, dl.py") ?? main;
    const sentences = [...part.querySelectorAll("p, li:not(:has(p)), dd:not(:has(p))")]
      .filter((paragraph) => !paragraph.closest(OMITTED))
      .flatMap((paragraph) => paragraph.textContent.trim().split(/(?<=[.?!])\s+(?=\p{Lu})/u));
    const words = [...keywords].map((word) => word.toLowerCase());
    const has = (word) => (sentence) => sentence.toLowerCase().includes(word);
    const first = [
      sentences.findIndex((sentence) => words.every((word) => has(word)(sentence))),
      ...words.map((word) => sentences.findIndex(has(word))),
      0,
    ].find((index) => index >= 0);
    let text = "";
    for (const sentence of sentences.slice(first)) {
      if (text.length + sentence.length > LENGTH && text) break;
      text = `${text} ${sentence}`.trim();
    }
    const summary = document.createElement("p");
    summary.className = "context";
    summary.textContent = text;
    return summary;
  };
}
