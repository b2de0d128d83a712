"""The commands of a shell script: enough of bash's grammar to tell what a script calls, without running it."""
import re
import string

RESERVED = {"!", "{", "}", "if", "then", "elif", "else", "fi", "while", "until", "do", "done", "esac", "time"}
ASSIGNMENT = re.compile(r"[A-Za-z_]\w*(\[[^\]]*\])?\+?=")


class Word:
    """A word without its quotes. It is `literal` without expansions, and `plain` without quotes as well."""

    def __init__(self, text, literal, plain):
        self.text, self.literal, self.plain = text, literal, plain


class Command:
    """A simple command: its words, the line of the first, and the texts of its here-documents."""

    def __init__(self, line):
        self.line, self.words, self.documents = line, [], []

    def name(self):
        """The first word, or None where it is known at run time only."""
        return self.words[0].text if self.words[0].literal else None


def read(text, first_line=1):
    """All commands of the script, those of $(...) too, and the names of its functions."""
    reader = _Reader(text, first_line)
    while reader.at < len(text):
        reader.commands()
    return reader.found, reader.functions


class _Reader:
    def __init__(self, text, first_line):
        self.text, self.first_line, self.at = text, first_line, 0
        self.found, self.functions, self.pending = [], set(), []

    def peek(self, expected):
        return self.text.startswith(expected, self.at)

    def line(self):
        return self.first_line + self.text.count("\n", 0, self.at)

    def commands(self, closing=None):
        """Read up to `closing`, which is taken too, or to the end."""
        command, cases, pattern = Command(self.line()), 0, False
        while self.at < len(self.text):
            if pattern:
                pattern = False
                if not self.case_pattern():
                    cases -= 1
                continue
            here = self.text[self.at]
            if here == closing:
                self.at += 1
                break
            if here in " \t":
                self.at += 1
            elif self.peek("\\\n"):
                self.at += 2
            elif here == "#":
                self.comment()
            elif here in "\n;&|" and not self.peek("&>"):
                command = self.finish(command)
                pattern = cases > 0 and (self.peek(";;") or self.peek(";&"))
                if here == "\n":
                    self.newline()
                else:
                    self.skip(";&|")
                command.line = self.line()
            elif here in "<>" or self.peek("&>"):
                self.redirection(command)
            elif self.peek("((") and [word.text for word in command.words] in ([], ["for"]):
                self.at += 1
                self.balanced("(", ")")
            elif here == "(":
                self.at += 1
                if len(command.words) == 1 and re.compile(r"\s*\)").match(self.text, self.at):
                    self.functions.add(command.words[0].text)
                    self.at = self.text.index(")", self.at) + 1
                    command.words = []
                else:
                    self.commands(")")
            elif here == ")":
                self.at += 1  # of no use to anyone: a script that bash refuses
            else:
                line, word = self.line(), self.word()
                if command.words or not (word.plain and word.text in RESERVED or ASSIGNMENT.match(word.text)):
                    if not command.words:
                        command.line = line
                    command.words.append(word)
                texts = [each.text for each in command.words]
                if texts == ["[["]:
                    self.condition()
                elif len(texts) == 3 and texts[0] == "case" and texts[2] == "in":
                    command.words, cases, pattern = [], cases + 1, True
                elif len(texts) == 2 and texts[0] == "function":
                    self.functions.add(texts[1])
                    command.words = []
        self.finish(command)

    def finish(self, command):
        if command.words:
            self.found.append(command)
        return Command(self.line())

    def skip(self, characters):
        while self.at < len(self.text) and self.text[self.at] in characters:
            self.at += 1

    def comment(self):
        end = self.text.find("\n", self.at)
        self.at = len(self.text) if end < 0 else end

    def newline(self):
        """The end of a line, after which the here-documents that it has named follow."""
        self.at += 1
        for command, word, tabs in self.pending:
            lines = []
            while self.at < len(self.text):
                end = (self.text + "\n").index("\n", self.at)
                line, self.at = self.text[self.at:end], end + 1
                if (line.lstrip("\t") if tabs else line) == word:
                    break
                lines.append(line)
            command.documents.append("\n".join(lines) + "\n")
        self.pending = []

    def case_pattern(self):
        """Read `a | b)`; false at `esac`."""
        while True:
            self.skip(string.whitespace)
            if not self.peek("#"):
                break
            self.comment()
        self.skip("(")
        first = True
        while self.at < len(self.text) and not self.peek(")"):
            if self.text[self.at] in " \t|\n":
                self.at += 1
            elif self.word().text == "esac" and first:
                return False
            first = False
        self.at += 1
        return True

    def condition(self):
        """The rest of [[ ... ]]."""
        while self.at < len(self.text):
            if self.text[self.at] in string.whitespace + "()<>|&;":
                self.at += 1
            elif self.word().text == "]]":
                return

    def redirection(self, command):
        if self.peek("<(") or self.peek(">("):
            self.at += 2
            self.commands(")")
            command.words.append(Word("", False, False))
            return
        if command.words and command.words[-1].text.isdigit() and self.text[self.at - 1].isdigit():
            command.words.pop()  # the 2 of 2>
        document = self.peek("<<") and not self.peek("<<<")
        self.skip("<>&")
        tabs = document and self.peek("-")
        if tabs:
            self.at += 1
        self.skip(" \t")
        if self.at < len(self.text) and self.text[self.at] not in "\n;|()<>" and not self.peek("&"):
            word = self.word()
            if document:
                self.pending.append((command, word.text, tabs))

    def word(self):
        parts, literal, plain, start = [], True, True, self.at
        while self.at < len(self.text):
            here = self.text[self.at]
            if here == "(" and ASSIGNMENT.fullmatch(self.text[start:self.at]):
                self.array()
                literal = False
            elif here in string.whitespace + ";&|<>()":
                break
            elif here == "\\":
                parts.append(self.text[self.at + 1:self.at + 2].strip("\n"))
                self.at += 2
            elif here == "'":
                end = (self.text + "'").index("'", self.at + 1)
                parts.append(self.text[self.at + 1:end])
                self.at, plain = end + 1, False
            elif here == '"':
                plain = False
                literal = self.double_quoted(parts) and literal
            elif here in "$`":
                self.expansion()
                literal = plain = False
            else:
                parts.append(here)
                self.at += 1
        if self.at == start:
            self.at += 1
        return Word("".join(parts), literal, plain)

    def array(self):
        """The elements of name=(...)."""
        self.at += 1
        while self.at < len(self.text) and not self.peek(")"):
            if self.text[self.at] in string.whitespace:
                self.at += 1
            elif self.peek("#"):
                self.comment()
            else:
                self.word()
        self.at += 1

    def double_quoted(self, parts):
        """Read "..." into the parts; whether it is literal."""
        literal = True
        self.at += 1
        while self.at < len(self.text) and not self.peek('"'):
            if self.peek("\\"):
                parts.append(self.text[self.at + 1:self.at + 2])
                self.at += 2
            elif self.text[self.at] in "$`":
                self.expansion()
                literal = False
            else:
                parts.append(self.text[self.at])
                self.at += 1
        self.at += 1
        return literal

    def expansion(self):
        if self.peek("$(("):
            self.at += 2
            self.balanced("(", ")")
        elif self.peek("$("):
            self.at += 2
            self.commands(")")
        elif self.peek("${"):
            self.at += 1
            self.balanced("{", "}")
        elif self.peek("`"):
            self.at += 1
            self.commands("`")
        elif self.peek("$'"):
            self.at = re.compile(r"\$'(\\.|[^'\\])*'?", re.S).match(self.text, self.at).end()
        else:
            self.at = re.compile(r"\$(\w+|[?#@*!$-])?").match(self.text, self.at).end()

    def balanced(self, opening, closing):
        """From an opening character to its closing one, with the commands of expansions inside."""
        depth = 0
        while self.at < len(self.text):
            here = self.text[self.at]
            if here == "\\":
                self.at += 2
            elif here == '"':
                self.double_quoted([])
            elif here in "$`":
                self.expansion()
            else:
                depth += (here == opening) - (here == closing)
                self.at += 1
                if depth == 0:
                    return
