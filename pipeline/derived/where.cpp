#include "pipeline/derived/where.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/enumerators.h"
#include "manifests/trust.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::derived {
namespace {

using TextOf = std::function<std::string(const WhereRow&)>;
using NumberOf = std::function<double(const WhereRow&)>;

const std::map<std::string, TextOf>& text_fields() {
  static const std::map<std::string, TextOf> fields{
      {"id", [](const WhereRow& row) { return row.verdict.id; }},
      {"dataset", [](const WhereRow& row) { return row.verdict.dataset; }},
      {"split", [](const WhereRow& row) { return row.verdict.split; }},
      {"source", [](const WhereRow& row) { return row.verdict.source; }},
      {"species", [](const WhereRow& row) { return row.verdict.species; }},
      {"family", [](const WhereRow& row) { return std::string(manifests::to_string(row.verdict.family)); }},
      {"verdict",
       [](const WhereRow& row) { return std::string(manifests::to_string(row.verdict.judgement.verdict)); }},
      {"reason",
       [](const WhereRow& row) { return std::string(manifests::to_string(row.verdict.judgement.reason)); }},
      {"label_kind", [](const WhereRow& row) {
         return row.label_kind ? std::string(manifests::to_string(*row.label_kind)) : std::string();
       }}};
  return fields;
}

std::map<std::string, NumberOf> make_number_fields() {
  std::map<std::string, NumberOf> fields{
      {"initial_error", [](const WhereRow& row) { return row.verdict.judgement.initial_error; }},
      {"final_error", [](const WhereRow& row) { return row.verdict.judgement.final_error; }},
      {"gain", [](const WhereRow& row) { return row.verdict.judgement.gain; }},
      {"iterations", [](const WhereRow& row) { return double(row.verdict.judgement.iterations); }},
      {"best_iteration", [](const WhereRow& row) { return double(row.verdict.judgement.best_iteration); }}};
  for (const manifests::TrustColumn& column : manifests::kTrustColumns) {
    fields[column.name] = [score = column.score](const WhereRow& row) {
      return row.verdict.judgement.trust.*score;
    };
  }
  return fields;
}

const std::map<std::string, NumberOf>& number_fields() {
  static const std::map<std::string, NumberOf> fields = make_number_fields();
  return fields;
}

struct Token {
  std::string text;
  std::size_t at = 0;  // position in the condition, from 0
  bool is_quoted = false;
};

bool is_symbol(char c) {
  return c == '(' || c == ')' || c == '=' || c == '<' || c == '>' || c == '!';
}

std::vector<Token> tokens_of(const std::string& text) {
  std::vector<Token> tokens;
  std::size_t at = 0;
  while (at < text.size()) {
    const char c = text[at];
    if (c == ' ' || c == '\t' || c == '\n') {
      ++at;
    } else if (c == '"') {
      const std::size_t end = text.find('"', at + 1);
      if (end == std::string::npos) {
        throw run::ConfigError(
            fmt::format("--where: the text that begins at character {} has no closing quote", at + 1));
      }
      tokens.push_back({text.substr(at + 1, end - at - 1), at, true});
      at = end + 1;
    } else if (is_symbol(c)) {
      const bool is_pair = (c == '<' || c == '>' || c == '!') && at + 1 < text.size() && text[at + 1] == '=';
      tokens.push_back({text.substr(at, is_pair ? 2 : 1), at});
      at += is_pair ? 2 : 1;
    } else {
      std::size_t end = at;
      while (end < text.size() && !is_symbol(text[end]) && text[end] != ' ' && text[end] != '\t' &&
             text[end] != '\n' && text[end] != '"') {
        ++end;
      }
      tokens.push_back({text.substr(at, end - at), at});
      at = end;
    }
  }
  return tokens;
}

class Parser {
 public:
  explicit Parser(const std::string& text) : text_(text), tokens_(tokens_of(text)) {}

  Condition parse() {
    Condition whole = condition();
    if (next_ < tokens_.size())
      fail("\"and\", \"or\" or the end; a value with spaces stands between double quotes");
    return whole;
  }

 private:
  [[noreturn]] void fail(const std::string& expected) const {
    const bool is_end = next_ >= tokens_.size();
    throw run::ConfigError(fmt::format("--where \"{}\": got {} at character {}, expected {}", text_,
                                       is_end ? "the end" : "\"" + tokens_[next_].text + "\"",
                                       (is_end ? text_.size() : tokens_[next_].at) + 1, expected));
  }

  bool take(std::string_view word) {
    if (next_ >= tokens_.size() || tokens_[next_].is_quoted || tokens_[next_].text != word) return false;
    ++next_;
    return true;
  }

  Condition condition() {
    Condition left = and_part();
    while (take("or")) {
      left = [left, right = and_part()](const WhereRow& row) { return left(row) || right(row); };
    }
    return left;
  }

  Condition and_part() {
    Condition left = not_part();
    while (take("and")) {
      left = [left, right = not_part()](const WhereRow& row) { return left(row) && right(row); };
    }
    return left;
  }

  Condition not_part() {
    // Parsing and evaluation recurse, so a text must not be able to choose the depth.
    constexpr int kMostParts = 1000;
    if (++parts_ > kMostParts) {
      throw run::ConfigError(fmt::format(
          "--where: got more than {} conditions, \"not\" and brackets, expected at most that", kMostParts));
    }
    if (take("not")) {
      return [inner = not_part()](const WhereRow& row) { return !inner(row); };
    }
    if (!take("(")) return comparison();
    Condition inner = condition();
    if (!take(")")) fail("\")\"");
    return inner;
  }

  Condition comparison() {
    const std::string field = next_ < tokens_.size() ? tokens_[next_].text : "";
    const auto text = text_fields().find(field);
    const auto number = number_fields().find(field);
    if (text == text_fields().end() && number == number_fields().end()) fail(expected_fields());
    ++next_;
    const std::string sign = take_operator(number != number_fields().end());
    if (next_ >= tokens_.size()) fail("a value");
    if (text != text_fields().end()) {
      check_name(field);
      return compare_text(text->second, sign, tokens_[next_++].text);
    }
    return compare_number(number->second, sign);
  }

  static std::string expected_fields() {
    std::string names;
    for (const auto& [name, get] : text_fields()) names += (names.empty() ? "" : ", ") + name;
    for (const auto& [name, get] : number_fields()) names += ", " + name;
    return "one of " + names;
  }

  std::string take_operator(bool is_number) {
    for (const std::string_view sign : {"=", "!="}) {
      if (take(sign)) return std::string(sign);
    }
    for (const std::string_view sign : {"<=", ">=", "<", ">"}) {
      if (is_number && take(sign)) return std::string(sign);
    }
    fail(is_number ? "=, !=, <, <=, > or >=" : "= or !=, since the field holds texts");
  }

  // Checks that a field with a fixed set of names is compared with one of them, or with "" if it may be
  // empty.
  void check_name(const std::string& field) const {
    const std::string& value = tokens_[next_].text;
    std::span<const std::string_view> names;
    if (field == "verdict") names = manifests::verdict_names();
    if (field == "reason") names = manifests::reason_names();
    if (field == "label_kind") names = manifests::label_kind_names();
    if (names.empty() || value.empty() || std::ranges::find(names, value) != names.end()) return;
    fail(fmt::format("one of {}", fmt::join(names, ", ")));
  }

  static Condition compare_text(const TextOf& get, const std::string& sign, const std::string& value) {
    return
        [get, value, is_equal = sign == "="](const WhereRow& row) { return (get(row) == value) == is_equal; };
  }

  Condition compare_number(const NumberOf& get, const std::string& sign) {
    const std::string& word = tokens_[next_].text;
    double value = 0.0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size()) fail("a number");
    ++next_;
    return [get, sign, value](const WhereRow& row) {
      const double got = get(row);
      if (sign == "=") return got == value;
      if (sign == "!=") return got != value;
      if (sign == "<") return got < value;
      if (sign == "<=") return got <= value;
      return sign == ">" ? got > value : got >= value;
    };
  }

  std::string text_;
  std::vector<Token> tokens_;
  std::size_t next_ = 0;
  int parts_ = 0;  // parts that were begun
};

}  // namespace

Condition parse_where(const std::string& text) {
  return Parser(text).parse();
}

}  // namespace q3d::pipeline::derived
