#include "loaders/pickled_names.h"

#include <fmt/format.h>

#include <charconv>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <variant>

namespace q3d::loaders {
namespace {

struct Value;
using Items = std::shared_ptr<std::vector<Value>>;  // shared, as a pickle's memo shares them
struct Mark {};
struct Value {
  std::variant<Mark, std::string, std::int64_t, Items> content;
};

void append_utf8(std::string& text, std::uint32_t code) {
  if (code < 0x80) {
    text += static_cast<char>(code);
  } else if (code < 0x800) {
    text += static_cast<char>(0xC0U | code >> 6U);
    text += static_cast<char>(0x80U | (code & 0x3FU));
  } else if (code < 0x10000) {
    text += static_cast<char>(0xE0U | code >> 12U);
    text += static_cast<char>(0x80U | (code >> 6U & 0x3FU));
    text += static_cast<char>(0x80U | (code & 0x3FU));
  } else {
    text += static_cast<char>(0xF0U | code >> 18U);
    text += static_cast<char>(0x80U | (code >> 12U & 0x3FU));
    text += static_cast<char>(0x80U | (code >> 6U & 0x3FU));
    text += static_cast<char>(0x80U | (code & 0x3FU));
  }
}

class Unpickler {
 public:
  Unpickler(std::string_view pickle, const std::string& where) : pickle_(pickle), where_(where) {}

  Value read() {
    while (true) {
      switch (const char opcode = next()) {
        case '(':
          push({Mark{}});
          break;
        case 'l':
        case 't':
          push({std::make_shared<std::vector<Value>>(pop_to_mark())});
          break;
        case ']':
        case ')':
          push({std::make_shared<std::vector<Value>>()});
          break;
        case 'a':
          append();
          break;
        case 'V':
          push({unescaped(line())});
          break;
        case 'I':
        case 'L':
          push({integer(line())});
          break;
        case 'p':
          memo_[integer(line())] = top();
          break;
        case 'g':
          push(recall(integer(line())));
          break;
        case '.':
          return pop();
        default:
          fail(fmt::format("the opcode 0x{:02x}", static_cast<unsigned char>(opcode)),
               "lists, tuples, texts and whole numbers of protocol 0; save the table as CSV instead");
      }
    }
  }

 private:
  [[noreturn]] void fail(const std::string& got, const std::string& expected) const {
    throw std::runtime_error(
        fmt::format("{}: byte {} of its pickle: got {}, expected {}", where_, at_, got, expected));
  }

  char next() {
    if (at_ >= pickle_.size()) fail("its end", "more");
    return pickle_[at_++];
  }

  std::string_view line() {
    const std::size_t end = pickle_.find('\n', at_);
    if (end == std::string_view::npos) fail("its end", "a line's end");
    const std::size_t start = std::exchange(at_, end + 1);
    return pickle_.substr(start, end - start);
  }

  // What is pushed is bounded: each push takes a byte, and values are shared, not copied.
  void push(Value value) { stack_.push_back(std::move(value)); }

  const Value& top() const {
    if (stack_.empty()) fail("nothing on the stack", "a value");
    return stack_.back();
  }

  Value pop() {
    Value value = top();
    stack_.pop_back();
    return value;
  }

  std::vector<Value> pop_to_mark() {
    std::size_t first = stack_.size();
    while (first > 0 && !std::holds_alternative<Mark>(stack_[first - 1].content)) --first;
    if (first == 0) fail("no mark on the stack", "one");
    std::vector<Value> items(stack_.begin() + static_cast<std::ptrdiff_t>(first), stack_.end());
    stack_.resize(first - 1);
    return items;
  }

  void append() {
    Value item = pop();
    const Value& list = top();
    const auto* items = std::get_if<Items>(&list.content);
    // A list within itself would never be freed, nor end.
    const auto* nested = std::get_if<Items>(&item.content);
    if (items == nullptr || (nested != nullptr && reaches(**nested, **items)))
      fail("no list", "a plain list");
    (*items)->push_back(std::move(item));
  }

  // Whether `wanted` is `from` or lies within it. Names lie three lists deep.
  static bool reaches(const std::vector<Value>& from, const std::vector<Value>& wanted, int depth = 0) {
    constexpr int kDeepest = 4;
    if (&from == &wanted || depth > kDeepest) return true;
    for (const Value& each : from) {
      const auto* items = std::get_if<Items>(&each.content);
      if (items != nullptr && reaches(**items, wanted, depth + 1)) return true;
    }
    return false;
  }

  std::int64_t integer(std::string_view text) const {
    if (text.ends_with('L')) text.remove_suffix(1);
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) fail("another text", "a whole number");
    return value;
  }

  const Value& recall(std::int64_t key) const {
    const auto found = memo_.find(key);
    if (found == memo_.end()) fail(fmt::format("the memo {}", key), "one that was put before");
    return found->second;
  }

  // Protocol 0 writes texts as Python's raw-unicode-escape: Latin-1, and \uXXXX or \UXXXXXXXX beyond it.
  std::string unescaped(std::string_view line) const {
    std::string text;
    for (std::size_t i = 0; i < line.size(); ++i) {
      std::uint32_t code = static_cast<unsigned char>(line[i]);
      const char kind = i + 1 < line.size() ? line[i + 1] : '\0';
      if (code == '\\' && (kind == 'u' || kind == 'U')) {
        const std::size_t digits = kind == 'u' ? 4 : 8;
        if (line.size() - i - 2 < digits) fail("a cut escape", "its digits");
        const char* start = line.data() + i + 2;
        const auto [end, error] = std::from_chars(start, start + digits, code, 16);
        if (error != std::errc() || end != start + digits || code > 0x10FFFF) fail("an escape", "hex digits");
        i += 1 + digits;
      }
      append_utf8(text, code);
    }
    return text;
  }

  std::string_view pickle_;
  const std::string& where_;
  std::size_t at_ = 0;
  std::vector<Value> stack_;
  std::map<std::int64_t, Value> memo_;
};

}  // namespace

std::vector<std::vector<std::string>> read_pickled_columns(std::string_view pickle,
                                                           const std::string& where) {
  const auto refuse = [&]() -> std::runtime_error {
    return std::runtime_error(
        fmt::format("{}: got a pickle of another form, expected a list of tuples of column names", where));
  };
  const auto items_of = [&](const Value& value) -> const std::vector<Value>& {
    const auto* items = std::get_if<Items>(&value.content);
    if (items == nullptr) throw refuse();
    return **items;
  };
  const Value read = Unpickler(pickle, where).read();
  const std::vector<Value>& axes = items_of(read);
  if (axes.size() != 1 || items_of(axes[0]).size() != 2) throw refuse();
  std::vector<std::vector<std::string>> columns;
  for (const Value& tuple : items_of(items_of(axes[0])[1])) {
    std::vector<std::string>& names = columns.emplace_back();
    for (const Value& name : items_of(tuple)) {
      const auto* text = std::get_if<std::string>(&name.content);
      if (text == nullptr) throw refuse();
      names.push_back(*text);
    }
  }
  return columns;
}

}  // namespace q3d::loaders
