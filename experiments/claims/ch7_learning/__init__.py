"""Thesis chapter 7, paper section 3: learning a model of the actions by curiosity."""
