"""The paper's tables on one's own data: many small trainings alike in all but what is compared, judged alike."""
