"""Changes of the contact mode that machine code recorded."""

import numpy as np

from gauss.dynamics.contact.contact_changes import ModeChange, RecordedChanges


def test_changes_follow_one_another_as_often_as_they_are_read():
    modes = np.array([0, 2, 1])
    numbers = np.array([[0, 1, 1, 0, 0.0], [0, 0, 1, 1, 0.5], [3, 1, 0, 0, 0.0], [4, 0, 2, 0, 0.25]])
    changes = RecordedChanges(numbers.ravel(), modes)
    expected = [
        ModeChange(0, 1, 2, 1, False, 0.0),
        ModeChange(0, 0, 0, 1, True, 0.5),
        ModeChange(3, 1, 1, 0, False, 0.0),
        ModeChange(4, 0, 1, 2, False, 0.25),
    ]
    assert len(changes) == len(expected)
    assert list(changes) == list(changes) == expected
    assert (modes == [0, 2, 1]).all()
