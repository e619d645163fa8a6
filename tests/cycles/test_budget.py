"""Work is counted, and where there is no more of it, that is an error."""

import pytest

from shimmy_ros.cycles.budget import STEPS_PER_SECOND, Budget, BudgetError


def test_a_budget_is_steps_per_second():
    assert Budget.of(1.0) == Budget(STEPS_PER_SECOND)
    assert Budget.of(0.001).left == STEPS_PER_SECOND // 1000


def test_what_is_spent_is_counted_and_what_is_left_can_be_spent_to_the_last_step():
    budget = Budget(100)
    budget.spend(30)
    assert (budget.left, budget.spent) == (70, 30)
    budget.spend(0)
    budget.spend(70)
    assert (budget.left, budget.spent) == (0, 100)
    with pytest.raises(BudgetError, match="more work than its budget allows"):
        budget.spend(1)
    assert budget.spent == 101


def test_a_budget_that_is_overdrawn_stays_so():
    budget = Budget(10)
    with pytest.raises(BudgetError):
        budget.spend(11)
    with pytest.raises(BudgetError):
        budget.spend(0)


def test_it_is_an_arithmetic_error():
    assert issubclass(BudgetError, ArithmeticError)
