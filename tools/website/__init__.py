"""The site: the pages of docs/ with generated ones beside them, built by Zensical into build/site."""
