// Lists that come page by page.

const MOST = 500;

/** All pages of a list, one after the other. @template {{ next?: string | null }} Page @param {(query: string) => Promise<Page>} ask */
export async function everyPage(ask) {
  /** @type {Page[]} */
  const pages = [];
  let cursor = "";
  do {
    const page = await ask(`limit=${MOST}${cursor && `&cursor=${encodeURIComponent(cursor)}`}`);
    pages.push(page);
    cursor = page.next ?? "";
  } while (cursor);
  return pages;
}
