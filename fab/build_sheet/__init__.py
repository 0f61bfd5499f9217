"""Build sheet as HTML and PDF: words, tables, step pictures."""
