"""Tests of the small runner: what passes, what fails and how, and what it refuses."""
import os
import pathlib
import subprocess
import sys
import unittest

import dotyk_case

SUPPORT = pathlib.Path(__file__).resolve().parent

# Each test fails at the line whose comment says how, but for those named "passes_...".
TESTS = """
@test
subroutine passes_values()
@assertEqual(1, 1)
@assertEqual(2_int64**40, [2_int64**40, 2_int64**40])
@assertEqual(3, [3_int64])
@assertEqual([1.0_dp, 2.0_dp], [1.0_dp, 2.1_dp], tolerance=0.2_dp, message='a, (b')
@assertEqual(0.0_dp, reshape([0.0_dp, 0.0_dp], [1, 2]))
@assertEqual('it''s', "it's")
@assertTrue(.true.)
@assertFalse(.false., message='no')
@assertLessThan(1, 2)
@assertGreaterThan(2.0_dp, 1.0_dp)
@assertLessThanOrEqual(1.0_dp, [1.0_dp, 1.5_dp])
@assertLessThanOrEqual([1, 2], [1, 3], message='no')
@assertGreaterThanOrEqual(2_int64**62 + 1, 2_int64**62)
@assertGreaterThan(2_int64**62 + 1, 2_int64**62)
@assertGreaterThanOrEqual(2, 1.5_dp)
@assertGreaterThanOrEqual(0.0_dp, -0.0_dp)
end subroutine
@test
subroutine nan()
  real(dp) :: x
  x = ieee_value(x, ieee_quiet_nan)
@assertEqual(x, x, tolerance=huge(x))
end subroutine
@test
subroutine place()
@assertEqual(0, reshape([0, 0, 0, 7], [2, 2]), message='look here')
end subroutine
@test
subroutine shape_differs()
@assertEqual([1, 2], [1, 2, 3])
end subroutine
@test
subroutine only_the_first_counts()
@assertTrue(.false.)
@assertTrue(.false., message='never reached')
end subroutine
@test
subroutine text()
@assertEqual('a', 'b')
end subroutine
@test
subroutine not_less()
@assertLessThan(2.5_dp, 1.5_dp)
end subroutine
@test
subroutine order_nan()
  real(dp) :: x
  x = ieee_value(x, ieee_quiet_nan)
@assertLessThanOrEqual(x, huge(x))
end subroutine
@test
subroutine order_array()
@assertGreaterThan([2, 1], [1, 1], message='where')
end subroutine
@test
subroutine order_equal()
@assertLessThan(2, 2)
end subroutine
@test
subroutine order_at_least()
@assertGreaterThanOrEqual(2_int64**62, 2_int64**62 + 1)
end subroutine
@test
subroutine order_shape()
@assertLessThanOrEqual([1, 2], 3)
end subroutine
@test
@disable
subroutine not_run()
@assertTrue(.false., message='disabled')
end subroutine
"""


class Runner(dotyk_case.Case):
    def refused(self, text, line, words, name="sample"):
        """What stands after `contains` of a module is refused at this line with these words."""
        source = self.write("sample.pf", "module %s\nuse funit\ncontains\n%s\nend module\n" % (name, text))
        done = subprocess.run([sys.executable, "-B", SUPPORT / "pf.py", source, self.folder / "sample.f90"],
                              capture_output=True, text=True)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("sample.pf:%d: " % line, done.stderr)
        self.assertIn(words, done.stderr)

    def run_tests(self, text, *options):
        """Build and run the tests."""
        uses = "use, intrinsic :: ieee_arithmetic\nuse, intrinsic :: iso_fortran_env, only: dp => real64, int64\n"
        source = self.write("sample.pf",
                            "module sample\nuse funit\n%sinteger :: n = 0\ncontains\n%s\nend module\n" % (uses, text))
        python = [sys.executable, "-B", str(SUPPORT / "pf.py")]
        subprocess.run([*python, source, "sample.f90"], cwd=self.folder, check=True)
        subprocess.run([*python, "--driver", "tests", "driver.f90", source], cwd=self.folder, check=True)
        subprocess.run([os.environ.get("FC", "gfortran"), "-ffree-line-length-none", "-ffpe-trap=invalid", "-o",
                        "tests", SUPPORT / "funit.f90", "sample.f90", "driver.f90"], cwd=self.folder, check=True)
        return subprocess.run([self.folder / "tests", *options], capture_output=True, text=True)

    def test_failures_are_told(self):
        done = self.run_tests(TESTS)
        self.assertEqual(done.returncode, 1, done)
        self.assertEqual(done.stdout.splitlines()[-1], "tests: 12 tests, 11 failed")
        for words in ("sample.pf:31: nan: expected NaN, found NaN",
                      "sample.pf:35: place: expected 0, found 7 at (2,2)\n  look here\n",
                      "shape_differs: expected shape (2), found (3)", 'expected "true", found "false"',
                      'text: expected "a", found "b"',
                      "not_less: 2.5000000000000000 is not less than 1.5000000000000000",
                      "order_nan: NaN is not less than or equal to 0.17976931348623157E+309",
                      "1 is not greater than 1 at (2)\n  where\n", "order_equal: 2 is not less than 2",
                      "4611686018427387904 is not greater than or equal to 4611686018427387905",
                      "order_shape: shape (2) is compared with shape ()"):
            self.assertIn(words, done.stdout)
        self.assertNotIn("never reached", done.stdout)
        self.assertNotIn("disabled", done.stdout)

    def test_set_up_and_choice_of_tests(self):
        text = ("@before\nsubroutine set_up()\nn = n + 1\nend subroutine\n@after\nsubroutine tear_down()\n"
                "n = n + 10\nend subroutine\n"
                "@test\nsubroutine first()\n@assertEqual(1, n)\nend subroutine\n"
                "@test\nsubroutine second()\n@assertEqual(12, n)\nend subroutine\n")
        done = self.run_tests(text)
        self.assertEqual((done.returncode, done.stdout), (0, "tests: 2 tests, 0 failed\n"))
        for part, code, line in (("first", 0, "tests: 1 tests, 0 failed\n"),
                                 ("third", 1, "tests: 0 tests, 0 failed\n")):
            done = subprocess.run([self.folder / "tests", "-f", part], capture_output=True, text=True)
            self.assertEqual((done.returncode, done.stdout), (code, line))

    def test_what_is_not_understood_is_refused(self):
        test = "@test\nsubroutine one()\n%s\nend subroutine"
        self.refused(test % "@assertNaN(x)", 6, "does not understand '@assertNaN(x)'")
        self.refused(test % "@assertEqual(1, 1) ! why", 6, "does not understand")
        self.refused(test % "@assertEqual(1, &", 6, "does not understand")
        self.refused(test % "@assertEqual(1)", 6, "do not parse")
        self.refused(test % "@assertEqual(1, (2)", 6, "do not parse")
        self.refused(test % "@assertEqual(1, 2, 3)", 6, "takes tolerance= and message=, not '3'")
        self.refused(test % "@assertLessThan(1.0, 2.0, tolerance=0.1)", 6, "takes message=, not 'tolerance=0.1'")
        self.refused(test % "@assertTrue(x, whitespace=KEEP_ALL)", 6, "not 'whitespace=KEEP_ALL'")
        self.refused("@test(ifdef=X)\nsubroutine one()", 4, "does not understand")
        # Directives of pFUnit that other projects use, and words that nobody knows.
        for line in ("@suite(name='s')", "@before(this)", "@after(npes=[1])", "@mpiTest(npes=[1, 2])", "@testCase",
                     "@testParameter(constructor=new)", "@parameters", "@ignore", "@disable", "@tets", "@ test", "@"):
            self.refused(line + "\nsubroutine one()\nend subroutine", 4, "does not understand '%s'" % line)
        self.refused(test % "@assertEqaul(1, 1)", 6, "does not understand '@assertEqaul(1, 1)'")
        self.refused(test % "@assertTrue", 6, "does not understand '@assertTrue'")
        self.refused(test % "#ifdef X", 6, "has no preprocessor: '#ifdef X'")
        self.refused("@test\ninteger function one()", 5, "a subroutine without arguments must follow @test")
        self.refused("@test\nsubroutine one(this)", 5, "a subroutine without arguments must follow @test")
        self.refused("@before\nsubroutine a()\nend subroutine\n@before\nsubroutine b()", 7,
                     "does not understand '@before'")
        self.refused("subroutine one()\nend subroutine", 6, "at least one test")
        self.refused("@test\n", 6, "must follow @test")
        self.refused(test % "", 8, "named as the file is", name="another")
        self.refused("@test\nsubroutine sample()", 6, "named otherwise")


if __name__ == "__main__":
    dotyk_case.main()
