#!/usr/bin/env python3
"""Checks that links within a built book lead to files and anchors: python3 docs/check_html.py FOLDER."""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """Links and anchors of a page."""

    def __init__(self, path):
        super().__init__()
        self.links, self.anchors = set(), {""}
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.anchors.update(attributes[name] for name in ("id", "name") if attributes.get(name))
        link = attributes.get("href" if tag == "a" else "src")
        if link and tag in ("a", "img", "script"):
            self.links.add(link)


def main():
    folder = Path(sys.argv[1]).resolve()
    pages = {path: Page(path) for path in folder.rglob("*.html")}
    broken = []
    for path, page in pages.items():
        # These are served at any address, or within other pages.
        if path.name in ("404.html", "toc.html"):
            continue
        for link in map(urlsplit, page.links):
            if link.scheme or link.netloc:
                continue
            target = (path.parent / unquote(link.path)).resolve() if link.path else path
            if not target.exists() or target in pages and unquote(link.fragment) not in pages[target].anchors:
                broken.append(f"{path.relative_to(folder)}: {link.geturl()}")
    print(f"{len(pages)} pages, {len(broken)} broken links")
    sys.exit("\n".join(broken) if broken else 0)


main()
