"""Random problems by the thousand: whether an answer is ever worse than its certificate claims."""
